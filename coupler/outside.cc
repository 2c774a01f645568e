#include "coupler/outside.h"

#include <fcntl.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <nlohmann/json.hpp>

namespace acopla::coupler {

ProcessOutside::ProcessOutside(bool supervised) : listens_(supervised) {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  sigaddset(&set, SIGHUP);
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  signals_ = signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
  if (listens_) fcntl(STDIN_FILENO, F_SETFL, fcntl(STDIN_FILENO, F_GETFL) | O_NONBLOCK);
}

ProcessOutside::~ProcessOutside() { close(signals_); }

std::vector<int> ProcessOutside::descriptors() const {
  std::vector<int> all{signals_};
  if (listens_) all.push_back(STDIN_FILENO);
  return all;
}

std::vector<Notice> ProcessOutside::read() {
  std::vector<Notice> notices;
  read_signals(notices);
  if (listens_) read_launcher(notices);
  return notices;
}

void ProcessOutside::read_signals(std::vector<Notice>& notices) {
  signalfd_siginfo info;
  while (::read(signals_, &info, sizeof info) == static_cast<ssize_t>(sizeof info))
    notices.push_back({});
}

void ProcessOutside::read_launcher(std::vector<Notice>& notices) {
  std::array<char, 4096> buffer;
  ssize_t count;
  while ((count = ::read(STDIN_FILENO, buffer.data(), buffer.size())) > 0)
    unfinished_.append(buffer.data(), static_cast<std::size_t>(count));
  const bool gone = count == 0 || (count < 0 && errno != EAGAIN && errno != EINTR);
  for (auto end = unfinished_.find('\n'); end != std::string::npos; end = unfinished_.find('\n')) {
    notices.push_back(notice_from_line(unfinished_.substr(0, end)));
    unfinished_.erase(0, end + 1);
  }
  if (gone) {
    listens_ = false;
    notices.push_back(
        {});  // without a launcher nobody waits for the results: the same as an interrupt
  }
}

std::string to_line(const Notice& notice) {
  static constexpr std::array names{"exited", "stopped", "interrupt"};
  const nlohmann::json line{{"event", names[static_cast<std::size_t>(notice.kind)]},
                            {"participant", notice.participant},
                            {"how", notice.how},
                            {"mistake", notice.mistake},
                            {"last_words", notice.last_words}};
  return line.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace) + "\n";
}

Notice notice_from_line(const std::string& line) {
  const auto read = nlohmann::json::parse(line);
  Notice notice;
  const auto event = read.at("event").get<std::string>();
  notice.kind = event == "exited"    ? Notice::Kind::exited
                : event == "stopped" ? Notice::Kind::stopped
                                     : Notice::Kind::interrupt;
  notice.participant = read.at("participant").get<std::string>();
  notice.how = read.at("how").get<std::string>();
  notice.mistake = read.at("mistake").get<bool>();
  notice.last_words = read.at("last_words").get<std::string>();
  return notice;
}

}  // namespace acopla::coupler
