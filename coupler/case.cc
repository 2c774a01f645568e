#include "coupler/case.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

namespace acopla::coupler {
namespace {

const std::vector<std::string> reserved{"title",    "dimension", "gravity", "end",
                                        "coupling", "expect",    "plugins"};

// A time as a number of windows; anything but a whole number is refused with the values that would
// do.
std::int64_t whole_windows(const io::Table& table, std::string_view key, double seconds,
                           double window) {
  const double exact = seconds / window;
  if (exact > 1e12)
    table.fail(key, fmt::format("= {:.10g} s is {:.3g} windows, more than this program can count.",
                                seconds, exact));
  const auto count = std::llround(exact);
  if (std::abs(static_cast<double>(count) * window - seconds) <= 1e-9 * std::max(seconds, window))
    return count;
  const double low = std::floor(exact), high = std::ceil(exact);
  table.fail(
      key,
      fmt::format(
          "= {:.10g} s is {:.10g} windows of {:.10g} s, not a whole number. Use {}{:.10g} s{}.",
          seconds, exact, window, low > 0 ? fmt::format("{:.10g} s or ", low * window) : "",
          high * window,
          key == "end" ? fmt::format(", or coupling.window = {:.10g}", seconds / high) : ""));
}

ReplayCase read_replay(const io::Table& table) {
  ReplayCase replay;
  if (table.is_text("replay")) {
    replay.file = table.path("replay");
  } else {
    const auto inner = table.table("replay");
    replay.file = inner.path("file");
    replay.from = inner.optional_number("from", io::non_negative);
    replay.to = inner.optional_number("to", io::positive);
    replay.at = inner.number("at", io::non_negative, 0);
    replay.of = inner.text("of", "");
    if (replay.from && replay.to && *replay.from >= *replay.to)
      inner.fail("to", "must be later than `from`.");
    inner.reject_unknown();
  }
  return replay;
}

ParticipantCase read_participant(const io::Table& table, bool substituted) {
  ParticipantCase participant;
  participant.name = table.name();
  participant.at = table.location();
  const int sorts = table.has("solver") + table.has("command") + table.has("replay");
  if (sorts == 0) {
    const auto near = io::nearest_word(table.name(), reserved);
    table.fail(
        fmt::format("is not a known key, and as a participant it lacks solver = \"…\", command = "
                    "[…] or replay = \"…\". {}",
                    near ? fmt::format("Did you mean {}?", *near) : "Add one."));
  }
  if (sorts > 1) table.fail("has more than one of solver, command and replay. Keep one.");
  participant.advance_limit = table.optional_number("advance_limit", io::positive);
  if (substituted) return participant;
  if (table.has("solver")) {
    participant.solver = table.text("solver");
  } else if (table.has("command")) {
    participant.command = table.texts("command");
    if (participant.command.empty())
      table.fail("command", "is empty. Name the program and its arguments.");
  } else {
    participant.replay = read_replay(table);
    table.reject_unknown();
  }
  return participant;
}

void read_participants(const io::Table& root, const std::optional<Substitute>& substitute,
                       Case& read) {
  for (const auto& [name, table] : root.named_tables()) {
    if (std::find(reserved.begin(), reserved.end(), name) != reserved.end()) continue;
    if (name.find_first_of("./") != std::string::npos)
      table.fail(
          "has a dot or slash in its name, which stands between a participant and its surfaces. "
          "Rename it.");
    const bool substituted = substitute && substitute->participant == name;
    read.participants.push_back(read_participant(table, substituted));
    if (substituted) read.participants.back().replay = substitute->replay;
    root.skip(name);
  }
  if (read.participants.empty())
    throw io::UserError(
        root.location(),
        "no participant: add a table with solver = \"dem\", solver = \"fem\" or command = […].");
}

SurfaceName surface_of(const std::string& text, const io::Table& table, std::string_view key, const Case& read) {
  const auto dot = text.find('.');
  if (dot == std::string::npos || dot == 0 || dot + 1 == text.size())
    table.fail(
        key, fmt::format("= \"{}\" is not a surface. Write participant.surface, e.g. \"{}.wall\".",
                         text, read.participants.front().name));
  SurfaceName name{text.substr(0, dot), text.substr(dot + 1)};
  if (name.surface.find('/') != std::string::npos)
    table.fail(key, "has a slash in the surface's name. Rename the surface.");
  if (!read.find(name.participant)) {
    std::vector<std::string> known;
    for (const auto& participant : read.participants) known.push_back(participant.name);
    const auto near = io::nearest_word(name.participant, known);
    table.fail(key, fmt::format("= \"{}\" names a participant that does not exist. {}", text,
                                near ? fmt::format("Did you mean \"{}.{}\"?", *near, name.surface)
                                     : fmt::format("There are: {}.", fmt::join(known, ", "))));
  }
  return name;
}

SurfaceName read_surface(const io::Table& table, std::string_view key, const Case& read) { return surface_of(table.text(key), table, key, read); }

/// One table: an interface for each surface that `to` names.
std::vector<InterfaceCase> read_interface(const io::Table& table, Case& read) {
  InterfaceCase interface;
  interface.from = read_surface(table, "from", read);
  interface.at = table.location();
  interface.from_at = table.location("from");
  interface.to_at = table.location("to");
  static const std::map<std::string, MappingKind> mappings{
      {"conservative", MappingKind::conservative}, {"overlap", MappingKind::overlap}, {"nearest", MappingKind::nearest}};
  interface.mapping = mappings.at(table.choice("mapping", {"conservative", "overlap", "nearest"}, "conservative"));
  if (!table.has("to")) {
    for (const char* key : {"mapping", "motion", "slides"})
      if (table.has(key)) table.fail(key, "has a meaning for an interface with `to` only. Remove it.");
    return {interface};
  }
  if (table.has("motion") && read.scheme == SchemeKind::one_way)
    table.fail("motion", "has a meaning where surfaces move: with scheme = \"explicit\", \"parallel\" or \"implicit\". Remove it.");
  interface.consistent_motion = table.choice("motion", {"conjugate", "consistent"}, "conjugate") == "consistent";
  if (table.has("slides") && read.scheme != SchemeKind::one_way)
    table.fail("slides", "is for surfaces that move by themselves, with scheme = \"one-way\": in two-way coupling the structure moves them. Remove it.");
  interface.slides = table.flag("slides", false);
  if (table.is_text("to")) {
    interface.to = read_surface(table, "to", read);
    return {interface};
  }
  std::vector<InterfaceCase> shared;
  for (const auto& text : table.texts("to")) {
    interface.to = surface_of(text, table, "to", read);
    interface.share = read.interfaces.size() + 1;
    shared.push_back(interface);
  }
  if (shared.size() < 2) table.fail("to", "lists a surface. Write several, which share the points of `from`, or one without brackets.");
  return shared;
}

void read_interfaces(const io::Table& coupling, Case& read) {
  for (const auto& table : coupling.list("interface"))
    for (auto& interface : read_interface(table, read)) {
      if (interface.from.participant == interface.to.participant)
        table.fail("to", "is the participant that sends. Name another.");
      for (const auto& other : read.interfaces)
        if (other.from == interface.from && other.to == interface.to)
          table.fail("repeats an interface. Remove one of the two.");
      read.interfaces.push_back(std::move(interface));
    }
  if (read.interfaces.empty() && read.participants.size() > 1)
    coupling.fail(
        fmt::format("has no [[coupling.interface]], and there are {} participants. Add one with "
                    "from = \"participant.surface\" and "
                    "to = \"participant.surface\"; only a participant alone needs none.",
                    read.participants.size()));
  for (const auto& interface : read.interfaces)
    if (read.receives(interface.from.participant))
      throw io::UserError(
          interface.from_at,
          fmt::format("{} receives forces and sends some too. A participant does one of the two: in a two-way scheme who "
                      "receives forces answers with its motion by itself. Remove one of the interfaces.",
                      interface.from.participant));
}

void read_scheme(const io::Table& coupling, bool couples, Case& read) {
  const std::vector<std::string> schemes{"one-way", "explicit", "parallel", "implicit"};
  const auto scheme = couples ? coupling.choice("scheme", schemes) : coupling.choice("scheme", schemes, "one-way");
  read.scheme = scheme == "explicit"   ? SchemeKind::serial_explicit
                : scheme == "parallel" ? SchemeKind::parallel_explicit
                : scheme == "implicit" ? SchemeKind::serial_implicit
                                       : SchemeKind::one_way;
  const bool explicitly = read.scheme == SchemeKind::serial_explicit || read.scheme == SchemeKind::parallel_explicit;
  if (explicitly) read.allows_unstable = coupling.flag("allow_unstable_scheme", false);
  if (read.scheme == SchemeKind::parallel_explicit && !read.allows_unstable)
    coupling.fail("scheme",
                  "= \"parallel\" loads the structure with the force of the window before, which makes energy at every window's length unless "
                  "the structure damps at least half of contact frequency times window. Use \"explicit\" or \"implicit\", or say "
                  "allow_unstable_scheme = true.");
  if (read.scheme != SchemeKind::serial_implicit) {
    for (const char* key : {"acceleration", "relaxation", "reuse", "filter", "tolerance", "max_iterations", "on_fail"})
      if (coupling.has(key)) coupling.fail(key, "has a meaning with scheme = \"implicit\" only. Remove it.");
    return;
  }
  auto& implicit = read.implicit;
  const auto kind = coupling.choice("acceleration", {"iqn-ils", "aitken", "constant"}, "iqn-ils");
  implicit.acceleration.kind = kind == "aitken"     ? AccelerationKind::aitken
                               : kind == "constant" ? AccelerationKind::constant
                                                    : AccelerationKind::iqn_ils;
  implicit.acceleration.relaxation = coupling.number("relaxation", {0, 1, true, false, "A step longer than 1 leaves the line."}, 0.5);
  if (implicit.acceleration.kind == AccelerationKind::iqn_ils) {
    implicit.acceleration.reuse = static_cast<int>(coupling.integer("reuse", 0, 1000, 0));
    implicit.acceleration.filter = coupling.number("filter", {0, 1, false, true, "It is a fraction."}, implicit.acceleration.filter);
  }
  if (coupling.is_table("tolerance")) {
    const auto tolerance = coupling.table("tolerance");
    implicit.relative = tolerance.number("relative", io::non_negative, implicit.relative);
    implicit.displacement = tolerance.number("displacement", io::non_negative, 0.0);
    implicit.force = tolerance.number("force", io::non_negative, 0.0);
    if (implicit.relative == 0 && (implicit.displacement == 0 || implicit.force == 0))
      tolerance.fail("relative", "= 0 needs both displacement [m] and force [N], since no window agrees with itself to the last bit.");
  } else {
    implicit.relative = coupling.number("tolerance", io::positive, implicit.relative);
  }
  implicit.most_iterations = static_cast<int>(coupling.integer("max_iterations", 1, 100000, implicit.most_iterations));
  implicit.stops = coupling.choice("on_fail", {"stop", "accept"}, "stop") == "stop";
}

void read_loads(const io::Table& coupling, Case& read) {
  if (read.scheme != SchemeKind::one_way) {
    for (const char* key : {"loads", "at", "over", "loads_from"})
      if (coupling.has(key)) coupling.fail(key, "has a meaning with scheme = \"one-way\" only. Remove it.");
    const bool moves = std::any_of(read.interfaces.begin(), read.interfaces.end(), [](const auto& i) { return !i.recorded_only(); });
    if (!moves) coupling.fail("scheme", "needs an interface with `to`: nobody would answer. Use \"one-way\".");
    for (std::size_t a = 0; a < read.interfaces.size(); ++a)
      for (std::size_t b = 0; b < a; ++b)
        if (const auto &one = read.interfaces[a], &other = read.interfaces[b];
            one.from == other.from && !one.recorded_only() && !other.recorded_only() && (one.share == 0 || one.share != other.share))
          throw io::UserError(one.from_at, fmt::format("{} would be moved by two surfaces. Name both in one interface, to = [\"{}\", \"{}\"], so that each of "
                                                       "its points belongs to the nearer.", one.from.text(), other.to.text(), one.to.text()));
    return;
  }
  static const std::map<std::string, Loads> known{{"history", Loads::history}, {"running_mean", Loads::running_mean}, {"mean", Loads::mean},
                                                  {"snapshot", Loads::snapshot}, {"peak", Loads::peak}};
  read.loads = known.at(coupling.choice("loads", {"history", "running_mean", "mean", "snapshot", "peak"}, "history"));
  const auto only_for = [&](const char* key, const char* which) {
    if (coupling.has(key))
      coupling.fail(key, fmt::format("has a meaning with loads = {} only. Remove it.", which));
  };
  if (std::all_of(read.interfaces.begin(), read.interfaces.end(),
                  [](const auto& i) { return i.recorded_only(); }))
    for (const char* key : {"at", "over", "loads_from"})
      if (coupling.has(key))
        coupling.fail(key,
                      "has no effect: no interface has a receiver. Add `to` to one, or remove it.");
  const bool by_window = read.loads == Loads::history || read.loads == Loads::running_mean;
  // Windows in steps are as long as they come out, and these times go to the nearest.
  const auto check_over = [&](double over) {
    if (read.window > 0 && whole_windows(coupling, "over", over, read.window) < 1) coupling.fail("over", "must be at least a window.");
  };
  auto& times = read.times;
  if (by_window) {
    only_for("at", "\"mean\", \"snapshot\" or \"peak\"");
    if (read.loads == Loads::history) only_for("over", "\"mean\", \"running_mean\" or \"peak\"");
    else check_over(times.load_over = coupling.number("over", io::positive));
    times.loads_from = coupling.number("loads_from", io::non_negative, 0);
    if (times.loads_from >= read.end * (1 - 1e-9) || (read.window > 0 && times.loads_from > read.end - read.window * (1 - 1e-9)))
      coupling.fail("loads_from", "leaves no window to send. Choose a time before `end`.");
    return;
  }
  only_for("loads_from", "\"history\" or \"running_mean\"");
  if (read.loads == Loads::snapshot) only_for("over", "\"mean\", \"running_mean\" or \"peak\"");
  const double at = coupling.number("at", io::positive, read.end);
  if (at > read.end * (1 + 1e-12))
    coupling.fail("at", fmt::format("= {:.10g} s is after the end, {:.10g} s.", at, read.end));
  times.load_at = at;
  if (read.window > 0) whole_windows(coupling, "at", at, read.window);
  // A mean is over one window unless more is asked for, a peak over all.
  if (read.loads == Loads::peak) times.load_over = at;
  if (read.loads != Loads::snapshot && coupling.has("over")) times.load_over = coupling.number("over", io::positive);
  if (times.load_over > 0) check_over(times.load_over);
  if (times.load_over > at * (1 + 1e-12)) coupling.fail("over", "reaches further back than the start.");
}

/// "steps:N" or "auto"
void read_window_in_steps(const io::Table& coupling, Case& read) {
  const auto text = coupling.text("window");
  read.in_steps.at = coupling.location("window");
  if (text == "auto") {
    if (read.scheme != SchemeKind::serial_explicit)
      coupling.fail("window", "= \"auto\" finds the longest windows in which scheme = \"explicit\" is stable. Give seconds, or \"steps:N\".");
    read.in_steps.automatic = true;
    read.in_steps.count = 1;
    return;
  }
  const std::string prefix = "steps:";
  const auto number = text.starts_with(prefix) ? text.substr(prefix.size()) : "";
  if (number.empty() || number.size() > 9 || number.find_first_not_of("0123456789") != std::string::npos || std::stol(number) < 1)
    coupling.fail("window", fmt::format("= \"{}\" is no window. Write seconds, \"steps:N\" for so many steps of the particles, or \"auto\".", text));
  read.in_steps.count = std::stol(number);
}

/// Times in windows of the length that is known now. Automatic ones begin and end in step where something falls due.
void count_windows(Case& read) {
  const auto& times = read.times;
  const auto unit = read.in_steps.automatic ? WindowInSteps::longest : 1;
  const auto count = [&](double time) { return unit * std::max<std::int64_t>(1, std::llround(std::min(time / read.window, 1e12) / static_cast<double>(unit))); };
  read.output_every = count(times.output_every);
  read.checkpoint_every = times.checkpoint_every > 0 ? count(times.checkpoint_every) : 0;
  read.loads_from = std::min(static_cast<std::int64_t>(std::ceil(times.loads_from / read.window - 1e-9)), read.windows - 1);
  read.load_end = times.load_at > 0 ? count(times.load_at) : 0;
  const auto over = times.load_over > 0 ? count(times.load_over) : 1;
  read.load_windows = over;
  read.load_start = std::max<std::int64_t>(0, read.load_end - over);
}

void read_coupling(const io::Table& root, Case& read) {
  if (!root.has("coupling"))
    throw io::UserError(root.location(),
                        "no [coupling]: add one with window = …, the seconds between reports, and, "
                        "where participants meet, "
                        "scheme, max_distance and [[coupling.interface]].");
  const auto coupling = root.table("coupling");
  // A participant alone only needs to know its windows.
  const bool couples = read.participants.size() > 1 || coupling.has("interface");
  read_scheme(coupling, couples, read);
  if (coupling.is_text("window")) {
    read_window_in_steps(coupling, read);
  } else {
    read.window = coupling.number("window", io::positive);
    read.windows = whole_windows(root, "end", read.end, read.window);
    if (read.windows < 1)
      coupling.fail("window", fmt::format("= {:.10g} s is longer than the run of {:.10g} s.",
                                          read.window, read.end));
  }
  read.max_distance = couples ? coupling.number("max_distance", io::positive)
                              : coupling.number("max_distance", io::positive, read.max_distance);
  read.start_limit = coupling.number("start_limit", io::positive, 60);
  // About twenty pictures are enough to see a run and small beside its series.
  read.times.output_every = coupling.number("output_every", io::positive, read.end / 20);
  read.times.checkpoint_every = coupling.optional_number("checkpoint_every", io::positive).value_or(0);
  const auto limits = coupling.table_or_empty("limits");
  read.limits.force_loss = limits.number("force_loss", io::non_negative, read.limits.force_loss);
  read.limits.moment_loss = limits.number("moment_loss", io::non_negative, read.limits.moment_loss);
  read.limits.unmapped = limits.integer("unmapped", 0, std::int64_t{1} << 40, read.limits.unmapped);
  if (coupling.has("record_motion") && read.scheme == SchemeKind::one_way)
    coupling.fail("record_motion", "has a meaning where surfaces move: with scheme = \"explicit\", \"parallel\" or \"implicit\". Remove it.");
  read.record_motion = coupling.flag("record_motion", false);
  if (read.scheme != SchemeKind::one_way) read.limits.energy_made = limits.optional_number("energy_made", io::non_negative);
  read_interfaces(coupling, read);
  read_loads(coupling, read);
  if (read.window > 0) count_windows(read);
}

void read_expectations(const io::Table& root, Case& read) {
  const auto expect = root.table_or_empty("expect");
  for (const auto& key : expect.keys()) {
    const auto table = expect.table(key);
    Expectation expectation;
    expectation.name = key;
    expectation.where = expect.location(key);
    const auto dot = key.find('.');
    if (dot == std::string::npos || !read.find(key.substr(0, dot)))
      expect.fail(key,
                  "names no quantity of a participant. Write \"participant.quantity\" in quotes, "
                  "e.g. \"structure.reaction.z\".");
    expectation.value = table.number("value");
    if (table.has("relative") == table.has("absolute"))
      table.fail("needs a tolerance: either relative = … or absolute = … in the quantity's unit.");
    expectation.relative = table.has("relative");
    expectation.tolerance =
        table.number(expectation.relative ? "relative" : "absolute", io::non_negative);
    if (expectation.relative && expectation.value == 0)
      table.fail("relative", "has no meaning for an expected value of 0. Use absolute.");
    expectation.mean_over = table.number("mean_over", io::positive, 0.0);
    expectation.at = table.number(
        "at", {0, read.end * (1 + 1e-12), true, false, "The run ends there."}, read.end);
    expectation.source = table.text("source", "");
    read.expectations.push_back(std::move(expectation));
  }
}

// A substitute without a name stands for the only participant that sends.
void resolve(const io::Table& root, std::optional<Substitute>& substitute) {
  std::vector<std::string> senders, movers;
  const bool moves = root.table("coupling").text("scheme", "one-way") != "one-way";
  for (const auto& interface : root.table("coupling").list("interface")) {
    const auto add_owner = [&](const char* end, std::vector<std::string>& owners) {
      for (const auto& surface : interface.is_text(end) ? std::vector{interface.text(end)} : interface.texts(end)) {
        const auto owner = surface.substr(0, surface.find('.'));
        if (std::find(owners.begin(), owners.end(), owner) == owners.end()) owners.push_back(owner);
      }
    };
    add_owner("from", senders);
    if (moves && interface.has("to")) add_owner("to", movers);
  }
  const auto among = [&](const std::vector<std::string>& owners) { return std::find(owners.begin(), owners.end(), substitute->participant) != owners.end(); };
  if (substitute->participant.empty()) {
    if (senders.size() != 1)
      throw io::UserError(
          root.location(),
          fmt::format("{} participants send forces ({}). Name the one to replay with --as.",
                      senders.size(), fmt::join(senders, ", ")));
    substitute->participant = senders.front();
  } else if (!among(senders) && !among(movers)) {
    throw io::UserError(
        root.location(),
        fmt::format("{} sends no forces, so it cannot be replayed. Those that do: {}.",
                    substitute->participant, fmt::join(senders, ", ")));
  }
}

}  // namespace

std::string ParticipantCase::program() const {
  if (replay) return "a record";
  if (!solver.empty()) return "acopla-" + solver;
  return std::filesystem::path(command.front()).filename().string();
}

void Case::divide(double step) {
  const auto unit = in_steps.automatic ? WindowInSteps::longest : 1;
  windows = unit * std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(end / (step * static_cast<double>(in_steps.count * unit)) * (1 - 1e-9))));
  window = end / static_cast<double>(windows);
  count_windows(*this);
}

const ParticipantCase* Case::find(const std::string& participant) const {
  for (const auto& candidate : participants)
    if (candidate.name == participant) return &candidate;
  return nullptr;
}

bool Case::sends(const std::string& participant) const {
  return std::any_of(interfaces.begin(), interfaces.end(),
                     [&](const auto& i) { return i.from.participant == participant; });
}

bool Case::receives(const std::string& participant) const {
  return std::any_of(interfaces.begin(), interfaces.end(),
                     [&](const auto& i) { return i.to.participant == participant; });
}

Case read_case(const io::Table& root, const std::optional<Substitute>& substitute) {
  Case read;
  read.file = root.file();
  for (const char* key : {"title", "dimension", "gravity", "end", "coupling", "expect"})
    root.has(key);
  root.skip("plugins");
  for (const auto& key :
       root.keys()) {  // before a missing key is complained of: it may be the same one, misspelt
    if (root.is_table(key) || std::find(reserved.begin(), reserved.end(), key) != reserved.end())
      continue;
    const auto near = io::nearest_word(key, reserved);
    root.fail(key, fmt::format("is not a known key. {}",
                               near ? fmt::format("Did you mean {}?", *near)
                                    : fmt::format("Known here: {}.", fmt::join(reserved, ", "))));
  }
  auto named = substitute;
  if (named) resolve(root, named);
  read_participants(root, named, read);
  const auto path = std::filesystem::absolute(read.file).lexically_normal();
  read.title = root.text("title", path.parent_path().filename().string());
  read.dimension = static_cast<int>(root.integer("dimension", 2, 3));
  if (root.has("gravity")) read.gravity = root.vector("gravity", read.dimension);
  read.end = root.number("end", io::positive);
  read_coupling(root, read);
  read_expectations(root, read);
  root.reject_unknown();
  read.text = root.canonical({"title", "end", "coupling.output_every", "coupling.checkpoint_every"}) +
              fmt::format(" {:.17g} {:.17g}", read.times.load_at, read.times.load_over);  // of which the end is the default
  return read;
}

}  // namespace acopla::coupler
