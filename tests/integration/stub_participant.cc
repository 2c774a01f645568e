// A participant for kill_test.py: stub_participant send|receive [--pause MILLISECONDS] [--at WINDOW
// --do MISHAP] [--never].
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>

#include "protocol/keys.h"
#include "protocol/serve.h"
#include "tests/integration/stubs.h"

namespace {

using namespace acopla;

template <class Stub>
int serve(Stub stub, std::chrono::milliseconds pause, const stubs::Mishap& mishap) {
  stub.pause = pause;
  stub.mishap = mishap;
  protocol::ServeOptions options;
  options.endpoint = std::getenv("ACOPLA_ENDPOINT");
  options.name = std::getenv("ACOPLA_PARTICIPANT");
  options.keys = protocol::keys_of_environment();
  protocol::serve(stub, options);
  return 0;
}

int run(int argc, char** argv) {
  const std::map<std::string, stubs::Mishap::Kind> kinds{
      {"exception", stubs::Mishap::Kind::exception},
      {"user_error", stubs::Mishap::Kind::user_error},
      {"hang", stubs::Mishap::Kind::hang},
      {"die", stubs::Mishap::Kind::die}};
  std::chrono::milliseconds pause{0};
  stubs::Mishap mishap;
  for (int k = 2; k < argc; ++k) {
    const std::string word = argv[k];
    if (word == "--pause") pause = std::chrono::milliseconds(std::atoi(argv[++k]));
    if (word == "--at") mishap.window = std::atoi(argv[++k]);
    if (word == "--do") mishap.kind = kinds.at(argv[++k]);
    if (word == "--never") std::this_thread::sleep_for(std::chrono::hours(1));
  }
  std::puts("the stub has started");
  std::fflush(stdout);
  return std::strcmp(argv[1], "send") == 0 ? serve(stubs::Sender(), pause, mishap)
                                           : serve(stubs::Receiver(), pause, mishap);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const io::UserError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return io::exit_user_error;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "stub: %s\n", error.what());
    return io::exit_failure;
  }
}
