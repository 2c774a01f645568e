// acopla-coupler: the hub of a coupled run.
#include <fmt/format.h>
#include <malloc.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <filesystem>

#include "coupler/announcer.h"
#include "coupler/coupler.h"
#include "coupler/replay.h"
#include "io/results.h"

namespace acopla::coupler {
namespace {

struct Arguments {
  std::string case_file, endpoint = "tcp://127.0.0.1:*", results, keys = protocol::keys_of_environment();
  std::string record, replay_as, replay_of;
  std::optional<double> replay_from, replay_to;
  double replay_at = 0;
  bool supervised = false, check = false, resumes = false;
};

std::optional<Substitute> substitute(const Arguments& arguments) {
  if (arguments.record.empty()) return std::nullopt;
  return Substitute{arguments.replay_as,
                    {arguments.record, arguments.replay_of, arguments.replay_from,
                     arguments.replay_to, arguments.replay_at}};
}

// Records are read before anybody is started; the other participants check their own tables.
int check(const Case& read) {
  for (const auto& participant : read.participants)
    if (participant.replay) Replay(*participant.replay, participant.name);
  return io::exit_done;
}

int run(const Arguments& arguments) {
  ProcessOutside outside(arguments.supervised);  // before any thread
  std::unique_ptr<Reporter> reporter;
  if (arguments.supervised)
    reporter = std::make_unique<SupervisedAnnouncer>();
  else
    reporter = std::make_unique<PlainAnnouncer>();
  const auto read = read_case(io::Table::from_file(arguments.case_file), substitute(arguments));
  if (arguments.check) return check(read);
  // The launcher has made the folder already, for everybody's logs.
  const auto results = arguments.supervised || arguments.resumes
                           ? arguments.results
                           : io::make_results_folder(arguments.case_file, arguments.results);
  if (arguments.resumes && results.empty()) throw io::UserError("--resume goes on with a run: name its folder with --results.");
  std::optional<protocol::Keys> keys;
  if (!arguments.keys.empty() && arguments.endpoint.starts_with("tcp://")) keys = protocol::read_coupler_keys(arguments.keys);
  zmq::context_t context;
  const auto outcome =
      Coupler(context, read, {arguments.endpoint, results, &outside, arguments.resumes, keys ? &*keys : nullptr}, *reporter).run();
  if (!arguments.supervised) fmt::print("results in {}\n", results);
  return outcome.exit_code;
}

void declare(CLI::App& app, Arguments& arguments) {
  app.add_option("case", arguments.case_file, "the case file, e.g. case.toml")->required();
  app.add_option("--bind", arguments.endpoint,
                 "address for the participants, ipc:///PATH or tcp://127.0.0.1:PORT; with keys tcp://0.0.0.0:PORT too");
  app.add_option("--keys", arguments.keys, "folder with coupler.keys, for tcp beyond loopback (default: ACOPLA_KEYS)");
  app.add_option("--results", arguments.results, "folder for the results (must not exist, unless a run is resumed)");
  app.add_flag("--resume", arguments.resumes, "go on from the checkpoint in the results folder");
  app.add_option("--replay", arguments.record,
                 "a record that plays the part of a participant that sends");
  app.add_option("--replay-as", arguments.replay_as,
                 "which participant it stands for (default: the only one that sends)");
  app.add_option("--replay-of", arguments.replay_of,
                 "whose surfaces of the record (default: the same name)");
  app.add_option("--replay-from", arguments.replay_from, "start of the part that is played [s]");
  app.add_option("--replay-to", arguments.replay_to, "its end [s]");
  app.add_option("--replay-at", arguments.replay_at, "time of this run at which it starts [s]");
  app.add_flag("--supervised", arguments.supervised,
               "speak JSON with a launcher over the standard streams");
  app.add_flag("--check", arguments.check,
               "check the case but for the participants' own tables, and end");
}

int main_program(int argc, char** argv) {
  std::signal(SIGPIPE, SIG_IGN);
  // Fields come and go with every window: their memory is kept, not given back and faulted in again.
  mallopt(M_MMAP_THRESHOLD, 256 << 20);
  mallopt(M_TRIM_THRESHOLD, 256 << 20);
  CLI::App app("acopla-coupler: couples the participants of a case that connect to it.");
  Arguments arguments;
  declare(app, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? io::exit_done : io::exit_user_error;
  }
  try {
    return run(arguments);
  } catch (const io::UserError& error) {
    fmt::print(stderr, "{}\n", error.what());
    return io::exit_user_error;
  } catch (const std::exception& error) {
    fmt::print(stderr, "acopla-coupler: {}\n", error.what());
    return io::exit_failure;
  }
}

}  // namespace
}  // namespace acopla::coupler

int main(int argc, char** argv) { return acopla::coupler::main_program(argc, argv); }
