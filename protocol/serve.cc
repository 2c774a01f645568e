#include "protocol/serve.h"

#include "io/error.h"

namespace acopla::protocol {
namespace {

void run(Participant& participant, Session& session) {
  session.offer(participant.start(session.run()));
  for (Window window; session.next(window);) session.answer(participant.advance(window, session.received()));
  session.finish(participant.finish());
}

}  // namespace

void serve(Participant& participant, const ServeOptions& options) {
  Session session(participant.introduce(), options,
                  {[&] { participant.save(); }, [&] { participant.restore(); },
                   [&](const std::string& folder) { participant.checkpoint(folder); },
                   [&](const std::string& folder) { participant.resume(folder); }});
  try {
    run(participant, session);
  } catch (const io::UserError& error) {
    session.fail(error.what(), true);
    throw;
  } catch (const std::exception& error) {
    session.fail(error.what());
    throw;
  } catch (...) {
    session.fail("an exception that is not a std::exception");
    throw;
  }
}

}  // namespace acopla::protocol
