#include "cli/conformance.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>

#include "cli/participants.h"
#include "cli/process.h"
#include "cli/workplace.h"
#include "conformance/examination.h"
#include "coupler/crew.h"

namespace acopla::cli {
namespace {

namespace fs = std::filesystem;

/// The participant as a child of this process.
class ChildSubject final : public conformance::Subject {
 public:
  using MakeCommand = std::function<Command(const std::string& endpoint)>;
  ChildSubject(std::string name, std::string log, MakeCommand make) : name_(std::move(name)), log_(std::move(log)), make_(std::move(make)) {}

  void start(const std::string& endpoint) override {
    std::error_code ignored;
    fs::remove(log_, ignored);  // last words are those of this life
    const auto command = make_(endpoint);
    child_.emplace(name_, command.words.front(), command, Child::Streams{log_, -1, -1});
  }
  std::optional<conformance::Ending> ended() override {
    child_->look();
    if (child_->running()) return std::nullopt;
    const int status = child_->status();
    return conformance::Ending{WIFSIGNALED(status), WIFEXITED(status) ? WEXITSTATUS(status) : 0, describe_exit(status)};
  }
  void end() override {
    child_->kill_group();
    while (child_->running()) {
      child_->look();
      usleep(1000);
    }
  }
  std::string last_words() const override {
    const auto lines = last_lines(log_, 1);
    return lines.empty() ? "" : lines.front();
  }

 private:
  std::string name_, log_;
  MakeCommand make_;
  std::optional<Child> child_;
};

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == at) parts.emplace_back();
    else parts.back() += c;
  }
  std::erase(parts, "");
  return parts;
}

protocol::Run::Use read_use(const std::string& text) {
  const auto first = text.find(':'), second = text.find(':', first == std::string::npos ? first : first + 1);
  if (first == 0 || first == std::string::npos || second == std::string::npos)
    throw io::UserError(fmt::format("--use {} is not SURFACE:RECEIVES:SENDS. Write e.g. --use top:force:displacement,velocity, or --use box::force for a "
                                    "surface that only sends.", text));
  return {text.substr(0, first), split(text.substr(first + 1, second - first - 1), ','), split(text.substr(second + 1), ',')};
}

const coupler::ParticipantCase& participant_of(const coupler::Case& read, const std::string& asked) {
  std::vector<std::string> names;
  for (const auto& participant : read.participants) {
    names.push_back(participant.name);
    if (participant.name == asked || (asked.empty() && read.participants.size() == 1)) return participant;
  }
  throw io::UserError({read.file, 0, 0}, asked.empty() ? fmt::format("has several participants. Name one with --as: {}.", fmt::join(names, ", "))
                                                       : fmt::format("has no participant {}. There are: {}.", asked, fmt::join(names, ", ")));
}

Command typed_command(const ConformanceOptions& options, const std::string& name, const std::string& endpoint) {
  coupler::ParticipantCase typed;
  typed.name = name;
  typed.command = options.command;
  auto command = command_of(typed, options.case_file, endpoint);
  command.folder.clear();  // as typed: from here
  return command;
}

}  // namespace

int list_rules() {
  for (const auto& rule : conformance::rules) fmt::print("{:15} {}  {}\n", rule.name, rule.section, rule.sentence);
  return io::exit_done;
}

int conformance(const ConformanceOptions& options) {
  std::signal(SIGPIPE, SIG_IGN);
  const Workplace workplace;
  conformance::Plan plan;
  std::optional<coupler::Case> read;
  const coupler::ParticipantCase* participant = nullptr;
  if (!options.case_file.empty()) {
    read = coupler::read_case(io::Table::from_file(options.case_file));
    participant = &participant_of(*read, options.participant);
    plan.participant = participant->name;
    plan.dimension = read->dimension;
    plan.run.uses = coupler::uses_of(*read, participant->name);
    std::copy(read->gravity.data(), read->gravity.data() + 3, plan.run.gravity);
  } else {
    plan.participant = options.participant.empty() ? "participant" : options.participant;
    plan.dimension = options.dimension;
  }
  for (const auto& text : options.uses) plan.run.uses.push_back(read_use(text));
  if (options.command.empty() && (!participant || participant->replay))
    throw io::UserError("nothing to examine: write the command after --, or name a participant of a case that is a process, with --case and --as.");
  plan.run.tick = options.window > 0 ? options.window : read ? read->window : 0.01;
  plan.run.window = 1;
  plan.run.end = std::max<std::int64_t>(read ? read->windows : 0, 100);
  plan.run.results = workplace.folder() + "/results";
  plan.endpoint = workplace.endpoint();
  plan.scratch = workplace.folder();
  const auto limit = [](double seconds) { return std::chrono::milliseconds(static_cast<std::int64_t>(seconds * 1000)); };
  plan.start_limit = limit(options.start_limit);
  plan.answer_limit = limit(options.answer_limit);
  plan.exit_limit = limit(options.exit_limit);
  plan.examines_silence = !options.quick;

  ChildSubject subject(plan.participant, workplace.folder() + "/log", [&](const std::string& endpoint) {
    return options.command.empty() ? command_of(*participant, options.case_file, endpoint) : typed_command(options, plan.participant, endpoint);
  });
  const auto report = conformance::examine(subject, plan);
  fmt::print("{}", report.text());
  return report.count(conformance::Verdict::broken) > 0 ? io::exit_missed : io::exit_done;
}

}  // namespace acopla::cli
