#include "coupler/announcer.h"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>

#include "coupler/outcome.h"

namespace acopla::coupler {
namespace {

constexpr std::chrono::milliseconds heartbeat{250};

void print_line(const std::string& line) {
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

}  // namespace

void PlainAnnouncer::ready(const std::string& endpoint) {
  print_line(fmt::format("coupler open at {}", endpoint));
}

void PlainAnnouncer::assembled(double seconds) {
  print_line(fmt::format("everybody is there after {:.2f} s", seconds));
}

void PlainAnnouncer::progress(std::int64_t window, std::int64_t windows, double time,
                              double seconds) {
  print_line(
      fmt::format("window {} of {}, t = {:.6g} s, after {:.1f} s", window, windows, time, seconds));
}

void PlainAnnouncer::note(const std::string& text) { print_line(text); }

void PlainAnnouncer::done(const Outcome& outcome) {
  if (outcome.error) print_line(outcome.error->message);
  for (const auto& checked : outcome.expectations)
    print_line(
        fmt::format("{} = {}, expected {:.10g}: {}", checked.expectation.name,
                    checked.value ? fmt::format("{:.10g}", *checked.value) : "never reported",
                    checked.expectation.value, checked.met ? "met" : "missed"));
  print_line(fmt::format("{} after {:.2f} s, {} windows complete", name_of(outcome.status),
                         outcome.seconds, outcome.windows));
}

SupervisedAnnouncer::SupervisedAnnouncer() : thread_([this] { beat(); }) {}

SupervisedAnnouncer::~SupervisedAnnouncer() {
  {
    const std::lock_guard lock(mutex_);
    end_ = true;
  }
  ending_.notify_all();
  thread_.join();
}

void SupervisedAnnouncer::beat() {
  std::unique_lock lock(mutex_);
  while (!ending_.wait_for(lock, heartbeat, [this] { return end_; })) {
    lock.unlock();
    say("{\"event\":\"alive\"}", false);
    lock.lock();
  }
}

// A launcher that was stopped (Ctrl-Z) must not stop the run: what is not vital is dropped while
// nobody reads.
void SupervisedAnnouncer::say(const std::string& line, bool must) {
  const std::lock_guard lock(mutex_);
  pollfd room{STDOUT_FILENO, POLLOUT, 0};
  if (!must && (poll(&room, 1, 0) != 1 || !(room.revents & POLLOUT))) return;
  const auto text = line + "\n";
  std::size_t written = 0;
  while (written < text.size()) {
    const auto count = ::write(STDOUT_FILENO, text.data() + written, text.size() - written);
    if (count < 0 && errno != EINTR) return;
    if (count > 0) written += static_cast<std::size_t>(count);
  }
}

void SupervisedAnnouncer::ready(const std::string& endpoint) {
  say(dump({{"event", "ready"}, {"endpoint", endpoint}}), true);
}

void SupervisedAnnouncer::assembled(double seconds) {
  say(dump({{"event", "assembled"}, {"seconds", seconds}}), false);
}

void SupervisedAnnouncer::progress(std::int64_t window, std::int64_t windows, double time,
                                   double seconds) {
  say(dump({{"event", "progress"},
            {"window", window},
            {"windows", windows},
            {"time", time},
            {"seconds", seconds}}),
      false);
}

void SupervisedAnnouncer::note(const std::string& text) { fmt::print(stderr, "{}\n", text); }

void SupervisedAnnouncer::done(const Outcome& outcome) {
  auto line = to_json(outcome);
  line["event"] = "done";
  say(dump(line), true);
}

}  // namespace acopla::coupler
