#include "cli/process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "io/error.h"

namespace acopla::cli {
namespace {

namespace fs = std::filesystem;

// Everything below runs between fork and exec of a process with one thread.
[[noreturn]] void become(const Command& command, const std::string& path) {
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  std::signal(SIGPIPE, SIG_DFL);
  for (const auto& [key, value] : command.environment) setenv(key.c_str(), value.c_str(), 1);
  if (!command.folder.empty() && chdir(command.folder.c_str()) != 0) _exit(127);
  std::vector<char*> words;
  for (const auto& word : command.words) words.push_back(const_cast<char*>(word.c_str()));
  words.push_back(nullptr);
  execv(path.c_str(), words.data());
  _exit(127);
}

void use_as(int descriptor, int target) {
  if (descriptor >= 0) dup2(descriptor, target);
}

std::string path_or_explain(const Command& command) {
  auto path = find_program(command.words.front(), command.folder.empty() ? "." : command.folder);
  if (path.empty())
    throw io::UserError(
        fmt::format("{} cannot be started: there is no such program. Check its name, and that it "
                    "may be executed.",
                    command.words.front()));
  return path;
}

}  // namespace

std::string find_program(const std::string& word, const std::string& folder) {
  const auto usable = [](const fs::path& path) {
    std::error_code error;
    return fs::is_regular_file(path, error) && access(path.c_str(), X_OK) == 0;
  };
  if (word.find('/') != std::string::npos) {
    const auto path = fs::absolute(fs::path(folder) / word).lexically_normal();
    return usable(path) ? path.string() : "";
  }
  const char* search = std::getenv("PATH");
  std::stringstream folders(search ? search : "/usr/bin:/bin");
  for (std::string entry; std::getline(folders, entry, ':');)
    if (const auto path = fs::absolute(fs::path(entry.empty() ? "." : entry) / word); usable(path))
      return path.string();
  return "";
}

std::string own_folder() { return fs::read_symlink("/proc/self/exe").parent_path().string(); }

std::string describe_exit(int wait_status) {
  if (WIFSIGNALED(wait_status))
    return fmt::format("was killed by signal {} ({})", WTERMSIG(wait_status),
                       strsignal(WTERMSIG(wait_status)));
  return fmt::format("ended with exit code {}", WEXITSTATUS(wait_status));
}

std::vector<std::string> last_lines(const std::string& path, std::size_t count) {
  std::ifstream stream(path, std::ios::binary);
  constexpr std::streamoff enough = 1 << 16;  // a log may be long, its end is what matters
  stream.seekg(0, std::ios::end);
  const auto size = static_cast<std::streamoff>(stream.tellg());
  stream.seekg(std::max<std::streamoff>(0, size - enough));
  std::deque<std::string> lines;
  for (std::string line; std::getline(stream, line);) {
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    lines.push_back(line);
    if (lines.size() > count) lines.pop_front();
  }
  return {lines.begin(), lines.end()};
}

int run_and_wait(const Command& command) {
  const auto path = path_or_explain(command);
  const pid_t pid = fork();
  if (pid == 0) become(command, path);
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : io::exit_failure;
}

Child::Child(std::string name, std::string program, const Command& command, const Streams& streams)
    : name_(std::move(name)), program_(std::move(program)), log_(streams.log) {
  const auto path = path_or_explain(command);
  const int log = open(streams.log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (log < 0)
    throw io::UserError({streams.log, 0, 0},
                        "the log cannot be written. Check the folder and the free space.");
  const int nothing = open("/dev/null", O_RDONLY | O_CLOEXEC);
  const pid_t launcher = getpid();
  pid_ = fork();
  if (pid_ == 0) {
    setpgid(0, 0);
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != launcher) _exit(127);  // it died before we asked to be told
    use_as(streams.input >= 0 ? streams.input : nothing, STDIN_FILENO);
    use_as(streams.output >= 0 ? streams.output : log, STDOUT_FILENO);
    use_as(log, STDERR_FILENO);
    become(command, path);
  }
  close(log);
  close(nothing);
  if (pid_ < 0)
    throw std::runtime_error(
        fmt::format("{} cannot be started: {}", program_, std::strerror(errno)));
  setpgid(pid_, pid_);  // here and in the child: whoever comes first
}

bool Child::look() {
  while (running_) {
    int status = 0;
    const pid_t changed = waitpid(pid_, &status, WNOHANG | WUNTRACED | WCONTINUED);
    if (changed <= 0) return false;
    if (WIFSTOPPED(status)) {
      stopped_ = std::chrono::steady_clock::now();
    } else if (WIFCONTINUED(status)) {
      stopped_.reset();
    } else {
      running_ = false;
      stopped_.reset();
      status_ = status;
      kill_group();  // what it started must not outlive it
      return true;
    }
  }
  return false;
}

std::optional<std::chrono::milliseconds> Child::stopped_for() const {
  if (!stopped_) return std::nullopt;
  return std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::steady_clock::now() -
                                                               *stopped_);
}

void Child::kill_group() const {
  if (pid_ > 0) kill(-pid_, SIGKILL);
}

}  // namespace acopla::cli
