#include "cli/display.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

namespace acopla::cli {
namespace {

using Json = nlohmann::ordered_json;

double number(const Json& value) { return value.is_number() ? value.get<double>() : std::nan(""); }

std::string duration(double seconds) {
  if (seconds < 60) return fmt::format("{:.0f} s", std::ceil(seconds));
  if (seconds < 3600)
    return fmt::format("{:.0f} min {:02.0f} s", std::floor(seconds / 60), std::fmod(seconds, 60));
  return fmt::format("{:.0f} h {:02.0f} min", std::floor(seconds / 3600),
                     std::floor(std::fmod(seconds, 3600) / 60));
}

std::string vector(const Json& value) {
  return fmt::format("({:.6g}, {:.6g}, {:.6g})", number(value[0]), number(value[1]),
                     number(value[2]));
}

std::size_t widest(const Json& list, const char* key, std::size_t least) {
  for (const auto& entry : list)
    least = std::max(least, entry.at(key).get_ref<const std::string&>().size());
  return least;
}

std::string interface_rows(const Json& outcome) {
  std::string text;
  for (const auto& interface : outcome.at("interfaces")) {
    text += fmt::format("\n{}, mean over the last window [N]\n",
                        interface.at("name").get<std::string>());
    text += fmt::format("  force sent     {}\n", vector(interface.at("sent")));
    text += fmt::format("  force mapped   {}\n", vector(interface.at("received")));
    text += fmt::format("  lost           {:.2g} of the sum of |F|, at worst {:.2g}\n",
                        number(interface.at("loss")), number(interface.at("worst_loss")));
  }
  return text;
}

std::string quantity_rows(const Json& outcome) {
  const auto& quantities = outcome.at("quantities");
  if (quantities.empty()) return "";
  std::size_t width = 24;
  for (const auto& pair : quantities)
    width = std::max(width, pair[0].get_ref<const std::string&>().size());
  auto text = fmt::format("\n{:{}}  {:>16}\n", "quantity", width, "last window");
  for (const auto& pair : quantities)
    text += fmt::format("{:{}}  {:>16.9g}\n", pair[0].get<std::string>(), width, number(pair[1]));
  return text;
}

std::string expectation_rows(const Json& outcome) {
  const auto& expectations = outcome.at("expectations");
  if (expectations.empty()) return "";
  const auto width = widest(expectations, "name", 24);
  auto text = fmt::format("\n{:{}}  {:>16}  {:>16}  {:>10}  {:>10}\n", "expected", width, "value",
                          "expected", "error", "tolerance");
  for (const auto& row : expectations) {
    const bool reported = row.at("value").is_number();
    const char* of = row.at("relative").get<bool>() ? "relative" : "absolute";
    text += fmt::format(
        "{:{}}  {:>16}  {:>16.9g}  {:>10}  {:>10.2g}  {}, {}{}\n",
        row.at("name").get<std::string>(), width,
        reported ? fmt::format("{:.9g}", number(row.at("value"))) : "not reported",
        number(row.at("expected")), reported ? fmt::format("{:.2e}", number(row.at("error"))) : "-",
        number(row.at("tolerance")), of, row.at("met").get<bool>() ? "met" : "MISSED",
        row.at("source").get<std::string>().empty()
            ? ""
            : " (" + row.at("source").get<std::string>() + ")");
  }
  return text;
}

std::string time_rows(const Json& outcome, double start_up) {
  std::size_t width = 24;
  for (const auto& [name, row] : outcome.at("participants").items())
    width = std::max(width, name.size() + row.at("solver").get<std::string>().size() + 3);
  auto text = fmt::format("\n{:{}}  {:>10}  {:>10}  {:>10}  {:>10}  {:>10}\n", "wall time", width,
                          "start-up", "computing", "waiting", "steps", "memory");
  for (const auto& [name, row] : outcome.at("participants").items()) {
    const double starting = number(row.at("seconds_starting"));
    text += fmt::format("{:{}}  {:>8.2f} s  {:>8.2f} s  {:>8.2f} s  {:>10}  {:>10}\n",
                        fmt::format("{} ({})", name, row.at("solver").get<std::string>()), width,
                        starting, number(row.at("seconds")) - starting,
                        number(row.at("seconds_waiting")), row.at("steps").get<std::uint64_t>(),
                        row.at("peak_bytes").get<std::uint64_t>()
                            ? fmt::format("{:.0f} MiB", number(row.at("peak_bytes")) / 1048576)
                            : "-");
  }
  return text + fmt::format("{:{}}  {:>8.2f} s  {:>8.2f} s in all\n", "run", width, start_up,
                            number(outcome.at("seconds")));
}

}  // namespace

Progress::Progress()
    : terminal_(isatty(STDOUT_FILENO) == 1), last_shown_(std::chrono::steady_clock::now()) {}

void Progress::show(std::int64_t window, std::int64_t windows, double time, double seconds) {
  const double fraction = static_cast<double>(window) / static_cast<double>(windows);
  const auto now = std::chrono::steady_clock::now();
  if (!terminal_ && window != windows &&
      (now - last_shown_ < std::chrono::seconds(2) || fraction - last_fraction_ < 0.1))
    return;
  last_shown_ = now;
  last_fraction_ = fraction;
  const double left = fraction > 0 ? seconds * (1 - fraction) / fraction : 0;
  const auto line = fmt::format(
      "{:3.0f} %  t = {:.6g} s  window {} of {}  {}", 100 * fraction, time, window, windows,
      window == windows ? fmt::format("after {:.1f} s", seconds) : duration(left) + " left");
  fmt::print("{}{}{}", terminal_ ? "\r\033[K" : "", line, terminal_ ? "" : "\n");
  open_ = terminal_;
  std::fflush(stdout);
}

void Progress::leave() {
  if (open_) fmt::print("\n");
  open_ = false;
  std::fflush(stdout);
}

std::string final_table(const Json& outcome, double start_up, const std::string& results) {
  return interface_rows(outcome) + quantity_rows(outcome) + expectation_rows(outcome) +
         time_rows(outcome, start_up) +
         fmt::format("\n{}: {} after {:.2f} s; results in {}\n",
                     outcome.at("case").get<std::string>(), outcome.at("status").get<std::string>(),
                     number(outcome.at("seconds")), shown_path(results));
}

std::string shown_path(const std::string& path) {
  std::error_code error;
  const auto relative = std::filesystem::relative(path, error).string();
  return error || relative.empty() || relative.size() > path.size() ? path : relative;
}

}  // namespace acopla::cli
