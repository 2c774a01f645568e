#include "cli/run.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <poll.h>
#include <sys/signalfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <utility>

#include "cli/display.h"
#include "cli/mpi_command.h"
#include "cli/participants.h"
#include "cli/process.h"
#include "cli/workplace.h"
#include "coupler/checkpoint.h"
#include "coupler/outcome.h"
#include "coupler/outside.h"
#include "io/results.h"

namespace acopla::cli {
namespace {

using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;
using coupler::Notice;
using namespace std::chrono_literals;

constexpr auto turn = 50ms;
constexpr auto stop_limit =
    1000ms;  // a process stopped for longer is taken for frozen; a debugger's touch is shorter
constexpr auto heartbeat_limit = 1750ms;  // of the coupler's silence
constexpr auto own_gap = 500ms;  // longer between two turns: this process itself was stopped
constexpr auto grace_well =
    20000ms;                        // for participants to write and end after a run that went well
constexpr auto grace_ill = 1000ms;  // and after one that did not
constexpr auto interrupt_limit = 3000ms;  // for the coupler to close its files after Ctrl-C
constexpr std::size_t words_shown = 5;

// SIGCHLD and the signals that end a run, as something to poll. Blocks them; children unblock them.
int open_signals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int number : {SIGCHLD, SIGINT, SIGTERM, SIGHUP}) sigaddset(&set, number);
  sigprocmask(SIG_BLOCK, &set, nullptr);
  return signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
}

// What the launcher itself has to say of a run whose coupler cannot.
struct Lost {
  std::string participant, state, message;
  int exit_code = io::exit_failure;
};

class Launch {
 public:
  Launch(const RunOptions& options, const coupler::Case& read, std::string results)
      : options_(options), case_(read), results_(std::move(results)), signals_(open_signals()) {
    guard_.watch_folder(workplace_.folder());
  }

  int run() {
    start();
    while (!over()) {
      wait();
      look_after_children();
      look_after_coupler();
      end_the_slow();
    }
    progress_.leave();
    return report();
  }

 private:
  void start();
  void start_coupler();
  bool over() const;
  void wait();
  void read_signals();
  void read_coupler();
  void hear(const Json& event);
  void look_after_children();
  void child_ended(Child& child);
  void look_after_coupler();
  void end_the_slow();
  void tell_coupler(const Notice& notice);
  void interrupt();
  void lose_coupler(const std::string& how);
  void begin_ending(std::chrono::milliseconds grace);
  void kill_all();
  int report();
  int report_outcome();
  int report_lost();
  void print_last_words(const std::string& participant) const;
  void print_where_results_are(std::int64_t windows, double time) const;
  std::string log_of(const std::string& name) const {
    return fmt::format("{}/log/{}.log", results_, name);
  }
  Child& coupler() { return *children_.front(); }

  const RunOptions& options_;
  const coupler::Case& case_;
  std::string results_;
  Guard guard_;
  Workplace workplace_;
  int signals_;
  int to_coupler_ = -1, from_coupler_ = -1;
  std::vector<std::unique_ptr<Child>> children_;  // the coupler first
  std::string unfinished_;
  Progress progress_;
  Json outcome_;  // the coupler's last word; null until it came
  std::optional<Lost> lost_;
  Clock::time_point begin_ = Clock::now(), last_turn_ = Clock::now(), last_beat_ = Clock::now();
  std::optional<Clock::time_point> deadline_;  // for everybody to be gone
  double start_up_ = 0, time_ = 0;
  std::int64_t windows_ = 0;
  bool interrupted_ = false;
  std::vector<std::string> told_stopped_;
};

void Launch::start() {
  std::filesystem::create_directories(results_ + "/log");
  start_coupler();
  for (const auto& participant : case_.participants) {
    if (participant.replay) continue;
    const auto command = command_of(participant, options_.case_file, workplace_.endpoint());
    children_.push_back(std::make_unique<Child>(participant.name, participant.program(), command,
                                                Child::Streams{log_of(participant.name)}));
    guard_.watch_group(children_.back()->pid());
  }
}

void Launch::start_coupler() {
  std::array<int, 2> input, output;
  if (pipe2(input.data(), O_CLOEXEC) != 0 || pipe2(output.data(), O_CLOEXEC) != 0)
    throw std::runtime_error("no pipe can be made");
  auto command = coupler_command(options_.case_file, options_.substitute);
  command.words.insert(command.words.end(),
                       {"--bind", workplace_.endpoint(), "--results", results_, "--supervised"});
  if (!options_.resume.empty()) command.words.push_back("--resume");
  children_.push_back(
      std::make_unique<Child>("coupler", "acopla-coupler", command,
                              Child::Streams{log_of("coupler"), input[0], output[1]}));
  close(input[0]);
  close(output[1]);
  to_coupler_ = input[1];
  from_coupler_ = output[0];
  fcntl(to_coupler_, F_SETFL, O_NONBLOCK);
  fcntl(from_coupler_, F_SETFL, O_NONBLOCK);
  guard_.watch_group(coupler().pid());
}

bool Launch::over() const {
  for (const auto& child : children_)
    if (child->running()) return false;
  return true;
}

void Launch::wait() {
  std::array<pollfd, 2> events{pollfd{signals_, POLLIN, 0}, pollfd{from_coupler_, POLLIN, 0}};
  poll(events.data(), from_coupler_ >= 0 ? 2 : 1,
       static_cast<int>(std::chrono::milliseconds(turn).count()));
  const auto now = Clock::now();
  if (now - last_turn_ > own_gap) last_beat_ = now;  // we were stopped, not the coupler
  last_turn_ = now;
  read_signals();
  read_coupler();
}

void Launch::read_signals() {
  signalfd_siginfo info;
  while (read(signals_, &info, sizeof info) == static_cast<ssize_t>(sizeof info))
    if (info.ssi_signo != SIGCHLD) interrupt();
}

void Launch::interrupt() {
  if (std::exchange(interrupted_, true)) return kill_all();  // asked twice: at once
  progress_.leave();
  fmt::print(stderr, "interrupted: ending all processes\n");
  if (!outcome_.is_null()) return;
  tell_coupler({});
  begin_ending(interrupt_limit);
}

void Launch::read_coupler() {
  if (from_coupler_ < 0) return;
  std::array<char, 4096> buffer;
  ssize_t count;
  while ((count = read(from_coupler_, buffer.data(), buffer.size())) > 0)
    unfinished_.append(buffer.data(), static_cast<std::size_t>(count));
  if (count == 0) {
    close(from_coupler_);
    from_coupler_ = -1;
  }
  for (auto end = unfinished_.find('\n'); end != std::string::npos; end = unfinished_.find('\n')) {
    last_beat_ = Clock::now();
    hear(Json::parse(unfinished_.substr(0, end)));
    unfinished_.erase(0, end + 1);
  }
}

void Launch::hear(const Json& event) {
  const auto kind = event.at("event").get<std::string>();
  if (kind == "assembled") start_up_ = std::chrono::duration<double>(Clock::now() - begin_).count();
  if (kind == "progress") {
    time_ = event.at("time").get<double>();
    windows_ = event.at("window").get<std::int64_t>();
    progress_.show(windows_, event.at("windows").get<std::int64_t>(), time_,
                   event.at("seconds").get<double>());
  }
  if (kind == "done") {
    outcome_ = event;
    begin_ending(outcome_.at("error").is_null() ? grace_well : grace_ill);
  }
}

void Launch::look_after_children() {
  for (auto& child : children_) {
    if (child->look()) {
      child_ended(*child);
    } else if (const auto stopped = child->stopped_for(); stopped && *stopped > stop_limit) {
      if (deadline_) {
        child->kill_group();  // it would not heed anything gentler
      } else if (child.get() == &coupler()) {
        lose_coupler("was stopped by a signal");
      } else if (std::find(told_stopped_.begin(), told_stopped_.end(), child->name()) ==
                 told_stopped_.end()) {
        told_stopped_.push_back(child->name());
        tell_coupler({Notice::Kind::stopped, child->name(),
                      "is frozen (it was stopped by a signal)", false, ""});
      }
    }
  }
}

void Launch::child_ended(Child& child) {
  guard_.forget_group(child.pid());
  if (&child == &coupler()) {
    read_coupler();  // its last line may still be in the pipe
    if (outcome_.is_null()) lose_coupler(describe_exit(child.status()));
    return;
  }
  const bool mistake =
      WIFEXITED(child.status()) && WEXITSTATUS(child.status()) == io::exit_user_error;
  const auto words = mistake ? last_lines(child.log(), 1) : std::vector<std::string>{};
  tell_coupler({Notice::Kind::exited, child.name(), describe_exit(child.status()), mistake,
                words.empty() ? "" : words.front()});
}

void Launch::look_after_coupler() {
  if (deadline_ || !coupler().running() || Clock::now() - last_beat_ < heartbeat_limit) return;
  lose_coupler("is frozen: it gave no sign of life for 1.75 s");
}

void Launch::end_the_slow() {
  if (!deadline_ || Clock::now() < *deadline_) return;
  if (interrupted_ && outcome_.is_null()) lose_coupler("did not end in time after the interrupt");
  kill_all();
}

void Launch::tell_coupler(const Notice& notice) {
  const auto line = coupler::to_line(notice);
  if (write(to_coupler_, line.data(), line.size()) < 0) return;  // it is gone, which its exit tells
}

// The coupler can neither end the others nor write the summary: we do.
void Launch::lose_coupler(const std::string& how) {
  if (lost_) return;
  const auto state = windows_ == 0 ? std::string("starting")
                                   : fmt::format("after window {} of {}, at {:.6g} s", windows_,
                                                 case_.windows, time_);
  lost_ = Lost{"coupler", state,
               fmt::format("the coupler (acopla-coupler) {} {}.", how,
                           windows_ == 0 ? "while starting" : state)};
  const auto words = last_lines(log_of("coupler"), 1);
  if (!coupler().running() && WIFEXITED(coupler().status()) &&
      WEXITSTATUS(coupler().status()) == io::exit_user_error && !words.empty()) {
    lost_->message = words.front();
    lost_->exit_code = io::exit_user_error;
  }
  if (interrupted_) lost_->exit_code = io::exit_interrupted;
  kill_all();
}

void Launch::begin_ending(std::chrono::milliseconds grace) { deadline_ = Clock::now() + grace; }

void Launch::kill_all() {
  deadline_ = Clock::now();
  for (auto& child : children_)
    if (child->running()) child->kill_group();
}

int Launch::report() { return outcome_.is_null() ? report_lost() : report_outcome(); }

int Launch::report_outcome() {
  const auto& error = outcome_.at("error");
  if (error.is_null()) {
    fmt::print("{}", final_table(outcome_, start_up_, results_));
    for (const auto& child : children_)
      if (child->status() != 0 && child.get() != &coupler())
        fmt::print(stderr, "warning: the run is complete, but then {} ({}) {}; see {}\n",
                   child->name(), child->program(), describe_exit(child->status()),
                   shown_path(child->log()));
    return outcome_.at("exit_code").get<int>();
  }
  const int exit_code = outcome_.at("exit_code").get<int>();
  if (exit_code != io::exit_interrupted)
    fmt::print(stderr, "{}\n", error.at("message").get<std::string>());
  if (exit_code == io::exit_failure) print_last_words(error.at("participant").get<std::string>());
  print_where_results_are(outcome_.at("time").at("windows").get<std::int64_t>(),
                          outcome_.at("time").at("reached").get<double>());
  return exit_code;
}

int Launch::report_lost() {
  coupler::Outcome outcome;
  outcome.status = interrupted_ ? coupler::Status::interrupted : coupler::Status::failed;
  outcome.title = case_.title;
  outcome.end = case_.end;
  outcome.reached = time_;
  outcome.windows = windows_;
  outcome.seconds = std::chrono::duration<double>(Clock::now() - begin_).count();
  outcome.error = {lost_->participant, lost_->state, lost_->message};
  fmt::print(stderr, "{}\n", lost_->message);
  try {
    io::write_whole(results_ + "/summary.json", coupler::summary_text(outcome));
  } catch (const io::UserError& error) {
    fmt::print(stderr, "{}\n", error.what());
  }
  if (lost_->exit_code == io::exit_failure) print_last_words("coupler");
  print_where_results_are(windows_, time_);
  return lost_->exit_code;
}

void Launch::print_where_results_are(std::int64_t windows, double time) const {
  if (windows > 0)
    fmt::print(stderr, "Results up to {:.6g} s are in {}.\n", time, shown_path(results_));
  else
    fmt::print(stderr, "Nothing was computed; the logs are in {}/log.\n", shown_path(results_));
}

void Launch::print_last_words(const std::string& participant) const {
  for (const auto& child : children_) {
    if (child->name() != participant) continue;
    const auto words = last_lines(child->log(), words_shown);
    if (words.empty()) continue;
    fmt::print(stderr, "Its last words ({}):\n  {}\n", shown_path(child->log()),
               fmt::join(words, "\n  "));
  }
}

}  // namespace

int run(const RunOptions& options) {
  std::signal(SIGPIPE, SIG_IGN);
  const auto read = coupler::read_case(io::Table::from_file(options.case_file), options.substitute);
  int processes = 1;
  for (const auto& participant : read.participants) {
    if (participant.replay) continue;
    command_of(participant, options.case_file, "");  // says so before a results folder is made
    processes += participant.solver.empty() ? 1 : processes_of(options.case_file, participant.name);
  }
  std::string results;
  if (options.resume.empty()) {
    results = io::make_results_folder(options.case_file, options.results);
  } else {
    results = std::filesystem::absolute(options.resume).lexically_normal().string();
    while (results.ends_with('/')) results.pop_back();
    coupler::Checkpoints(read, results, true);  // says what is wrong before anybody is started
  }
  fmt::print("{}: {} processes, results in {}\n", read.title, processes, shown_path(results));
  std::fflush(stdout);
  return Launch(options, read, results).run();
}

}  // namespace acopla::cli
