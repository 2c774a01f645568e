// Coupler and participants in the threads of one process.
#pragma once

#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>
#include <vector>
#include <zmq.hpp>

#include "coupler/coupler.h"
#include "protocol/serve.h"

namespace acopla::in_process {

/// Tells participants when the coupler is open: over inproc nobody may knock before.
class Door : public coupler::Reporter {
 public:
  void ready(const std::string&) override {
    const std::lock_guard lock(mutex_);
    open_ = true;
    changed_.notify_all();
  }
  void close() {
    const std::lock_guard lock(mutex_);
    open_ = false;
  }
  void wait_until_open() {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, std::chrono::seconds(10), [this] { return open_; });
  }

 protected:
  std::mutex mutex_;
  std::condition_variable changed_;

 private:
  bool open_ = false;
};

struct Named {
  const char* name;
  protocol::Participant* participant;
};

/// Runs a case with these participants, each in a thread. What one of them throws is in the outcome, as the coupler heard it.
/// @param endpoint  of its own for every run. @param results  empty: none. @param resumes  from the checkpoint there. @throws io::UserError of the case
inline coupler::Outcome run(const std::string& text, const std::vector<Named>& participants, const std::string& endpoint, Door& door,
                            const std::string& results = {}, bool resumes = false) {
  const auto read = coupler::read_case(io::Table::from_text(text, "case.toml"));
  zmq::context_t context;
  std::vector<std::thread> threads;
  for (const auto& [name, participant] : participants)
    threads.emplace_back([&, name = name, participant = participant] {
      door.wait_until_open();
      try {
        protocol::serve(*participant, {endpoint, name, std::chrono::milliseconds(5000), &context});
      } catch (const std::exception&) {
      }
    });
  const auto join = [&] {
    for (auto& thread : threads) thread.join();
  };
  try {
    auto outcome = coupler::Coupler(context, read, {endpoint, results, nullptr, resumes}, door).run();
    join();
    return outcome;
  } catch (...) {
    join();
    throw;
  }
}

}  // namespace acopla::in_process
