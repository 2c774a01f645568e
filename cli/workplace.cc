#include "cli/workplace.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <set>
#include <stdexcept>

namespace acopla::cli {
namespace {

namespace fs = std::filesystem;
constexpr const char* prefix = "acopla-";

// The folders of launchers that are no more.
void remove_stale() {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator("/tmp", error)) {
    const auto name = entry.path().filename().string();
    if (!name.starts_with(prefix)) continue;
    pid_t pid = 0;
    const auto* begin = name.data() + std::strlen(prefix);
    const auto [end, failure] = std::from_chars(begin, name.data() + name.size(), pid);
    if (failure != std::errc{} || end == name.data() + name.size() || *end != '-' || pid <= 0)
      continue;
    if (kill(pid, 0) != 0 && errno == ESRCH) {
      std::error_code ignored;  // another user's, perhaps
      fs::remove_all(entry.path(), ignored);
    }
  }
}

void handle_line(const std::string& line, std::set<pid_t>& groups, std::string& folder) {
  if (line.empty()) return;
  const auto rest = line.substr(1);
  if (line[0] == 'd') folder = rest;
  if (line[0] == '+') groups.insert(std::stoi(rest));
  if (line[0] == '-') groups.erase(std::stoi(rest));
}

// The guard's whole life: listens until the launcher's end of the pipe closes, for whatever reason.
[[noreturn]] void stand_guard(int pipe) {
  setsid();
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) std::signal(number, SIG_IGN);
  const int nothing = open("/dev/null", O_RDWR);
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) dup2(nothing, stream);
  std::set<pid_t> groups;
  std::string folder, unfinished;
  std::array<char, 256> buffer;
  ssize_t count;
  while ((count = read(pipe, buffer.data(), buffer.size())) != 0) {
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) break;
    unfinished.append(buffer.data(), static_cast<std::size_t>(count));
    for (auto end = unfinished.find('\n'); end != std::string::npos; end = unfinished.find('\n')) {
      handle_line(unfinished.substr(0, end), groups, folder);
      unfinished.erase(0, end + 1);
    }
  }
  for (const auto group : groups) kill(-group, SIGKILL);
  std::error_code ignored;
  if (!folder.empty()) fs::remove_all(folder, ignored);
  _exit(0);
}

}  // namespace

Workplace::Workplace() {
  remove_stale();
  auto pattern = fmt::format("/tmp/{}{}-XXXXXX", prefix, getpid());
  if (!mkdtemp(pattern.data()))  // mode 0700
    throw std::runtime_error(
        fmt::format("no private folder can be made in /tmp: {}", std::strerror(errno)));
  folder_ = pattern;
}

Workplace::~Workplace() {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

Guard::Guard() {
  std::array<int, 2> ends;
  if (pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error("no pipe can be made");
  pid_ = fork();
  if (pid_ == 0) {
    close(ends[1]);
    stand_guard(ends[0]);
  }
  close(ends[0]);
  pipe_ = ends[1];
}

Guard::~Guard() {
  close(pipe_);
  while (waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

void Guard::watch_group(pid_t group) { tell(fmt::format("+{}\n", group)); }
void Guard::forget_group(pid_t group) { tell(fmt::format("-{}\n", group)); }
void Guard::watch_folder(const std::string& folder) { tell(fmt::format("d{}\n", folder)); }

void Guard::tell(const std::string& line) const {
  if (write(pipe_, line.data(), line.size()) < 0)
    return;  // killed itself: the children still die with their parent
}

}  // namespace acopla::cli
