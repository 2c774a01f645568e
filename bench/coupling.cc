// What two-way coupling costs and how well it does, as JSON lines: coupling orders | map [--coarse] | overhead VERTICES WINDOWS | waking VERTICES SECONDS | long WINDOWS [--recorded] | mapping VERTICES [--overlap]
#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>
#include <vector>

#include "coupler/mapping/mapping.h"
#include "tests/integration/in_process.h"
#include "tests/integration/oscillator.h"

namespace {

using namespace acopla;
using geometry::Vec3;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

// Takes the time of the windows alone.
class Watch final : public in_process::Door {
 public:
  void assembled(double) override { begin_ = Clock::now(); }
  void progress(std::int64_t, std::int64_t, double, double) override { seconds = seconds_since(begin_); }
  double seconds = 0;

 private:
  Clock::time_point begin_;
};

struct Result {
  coupler::Outcome outcome;
  double seconds = 0;
};

std::string case_text(double window, std::int64_t windows, const std::string& coupling) {
  return fmt::format("dimension = 3\nend = {}\n[coupling]\nwindow = {}\nmax_distance = 0.1\n{}\n[[coupling.interface]]\n"
                     "from = \"first.spring\"\nto = \"second.mass\"\n[first]\ncommand = [\"a\"]\n[second]\ncommand = [\"b\"]\n",
                     window * static_cast<double>(windows), window, coupling);
}

// @param address  "inproc" or "ipc"
Result run(double window, std::int64_t windows, const std::string& coupling, protocol::Participant& first, protocol::Participant& second,
           const std::string& address = "inproc") {
  static int runs = 0;
  const auto endpoint = address == "ipc" ? fmt::format("ipc:///tmp/acopla-bench-{}-{}", getpid(), ++runs) : fmt::format("inproc://bench-{}", ++runs);
  Watch watch;
  auto outcome = in_process::run(case_text(window, windows, coupling), {{"first", &first}, {"second", &second}}, endpoint, watch);
  return {std::move(outcome), watch.seconds};
}

struct Scheme {
  const char *name, *text;
};
const Scheme schemes[] = {{"explicit", "scheme = \"explicit\""},
                          {"parallel", "scheme = \"parallel\"\nallow_unstable_scheme = true"},
                          {"implicit, constant 0.5", "scheme = \"implicit\"\nacceleration = \"constant\"\nmax_iterations = 200\ntolerance = 1e-9"},
                          {"implicit, Aitken", "scheme = \"implicit\"\nacceleration = \"aitken\"\nmax_iterations = 200\ntolerance = 1e-9"},
                          {"implicit, iqn-ils", "scheme = \"implicit\"\nmax_iterations = 200\ntolerance = 1e-9"}};

// Two masses, a second: error against window and run time.
void orders() {
  for (const auto& scheme : schemes)
    for (int exponent = 4; exponent <= 11; ++exponent) {
      const std::int64_t windows = std::int64_t{1} << exponent;
      const double window = 1.0 / static_cast<double>(windows);
      oscillator::Loader first;
      oscillator::Structure second;
      const auto result = run(window, windows, scheme.text, first, second);
      double square = 0;
      for (std::size_t k = 0; k < second.history.size(); ++k) {
        const double t = window * static_cast<double>(k + 1);
        square += std::pow(first.history[k] - oscillator::exact(1, t), 2) + std::pow(second.history[k] - oscillator::exact(2, t), 2);
      }
      const double energy = 0.5 * (first.v * first.v + second.v * second.v) +
                            0.5 * oscillator::wall_spring * (first.u * first.u + second.u * second.u) +
                            0.5 * oscillator::middle_spring * std::pow(first.u - second.u, 2);
      const double start = 0.5 * (oscillator::wall_spring + oscillator::middle_spring);
      fmt::print("{{\"scheme\": \"{}\", \"windows\": {}, \"met\": {}, \"error\": {:.6g}, \"energy\": {:.6g}, \"iterations\": {:.4g}, \"seconds\": {:.4g}}}\n",
                 scheme.name, windows, result.outcome.error ? "false" : "true", std::sqrt(square / 2 / static_cast<double>(second.history.size())),
                 energy / start - 1, static_cast<double>(result.outcome.ledgers.iterations) / static_cast<double>(windows), result.seconds);
    }
}

// A sphere of mass m hits a plate of 1 kg on a spring K through a contact k = 1e4 N/m, seen for three half swings of the contact, in windows of 0.2
// radians of it; against both in one system by Runge–Kutta in steps a hundred times finer than the windows and than the plate's own swing.
void map(bool coarse) {
  const double contact = 1e4;
  const std::vector<int> masses = coarse ? std::vector<int>{-3, 0, 3} : std::vector<int>{-3, -2, -1, 0, 1, 2, 3};
  const std::vector<int> springs = coarse ? std::vector<int>{-6, -2, 0, 2, 6} : std::vector<int>{-6, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5, 6};
  for (const int mass_exponent : masses)
    for (const int spring_exponent : springs) {
      const double m = std::pow(10, mass_exponent), spring = contact * std::pow(10, spring_exponent);
      const double frequency = std::sqrt(contact * (1 / m + 1));
      const double window = 0.2 / frequency;
      const std::int64_t windows = 47;
      double u = 0, v = 1, w = 0, z = 0;  // sphere, plate
      {
        const double own = std::sqrt(spring), dt_wanted = std::min(window / 100, 0.05 / own), end = window * static_cast<double>(windows);
        const auto steps = static_cast<std::int64_t>(std::ceil(end / dt_wanted));
        const double dt = end / static_cast<double>(steps);
        const auto rate = [&](const double* y, double* r) {
          const double force = std::max(0.0, contact * (y[0] - y[2]));
          r[0] = y[1], r[1] = -force / m, r[2] = y[3], r[3] = force - spring * y[2];
        };
        for (std::int64_t n = 0; n < steps; ++n) {
          double y[4] = {u, v, w, z}, a[4], b[4], c[4], d[4], t[4];
          rate(y, a);
          for (int k = 0; k < 4; ++k) t[k] = y[k] + dt / 2 * a[k];
          rate(t, b);
          for (int k = 0; k < 4; ++k) t[k] = y[k] + dt / 2 * b[k];
          rate(t, c);
          for (int k = 0; k < 4; ++k) t[k] = y[k] + dt * c[k];
          rate(t, d);
          for (int k = 0; k < 4; ++k) y[k] += dt / 6 * (a[k] + 2 * b[k] + 2 * c[k] + d[k]);
          u = y[0], v = y[1], w = y[2], z = y[3];
        }
      }
      for (const auto& scheme : schemes) {
        oscillator::Loader first;
        oscillator::Structure second;
        first.only_pushes = true;
        first.u = 0, first.v = 1, first.wall = 0, first.own_mass = m, first.stiffness = contact;
        second.wall = spring;
        const auto result = run(window, windows, scheme.text, first, second);
        const double energy = 0.5 * m * first.v * first.v + 0.5 * second.v * second.v + 0.5 * spring * second.u * second.u +
                              0.5 * contact * std::pow(std::max(0.0, first.u - second.u), 2);
        fmt::print("{{\"scheme\": \"{}\", \"mass\": {}, \"spring\": {}, \"met\": {}, \"error\": {:.6g}, \"energy\": {:.6g}, \"iterations\": {:.4g}, "
                   "\"seconds\": {:.4g}}}\n",
                   scheme.name, mass_exponent, spring_exponent, result.outcome.error ? "false" : "true", std::abs(first.v - v), energy / (0.5 * m) - 1,
                   static_cast<double>(result.outcome.ledgers.iterations) / static_cast<double>(windows), result.seconds);
      }
    }
}

geometry::SurfaceMesh square(std::uint32_t n, double z) {
  geometry::SurfaceMesh mesh;
  for (std::uint32_t j = 0; j <= n; ++j)
    for (std::uint32_t i = 0; i <= n; ++i) mesh.points.emplace_back(double(i) / n, double(j) / n, z);
  const auto at = [&](std::uint32_t i, std::uint32_t j) { return j * (n + 1) + i; };
  for (std::uint32_t j = 0; j < n; ++j)
    for (std::uint32_t i = 0; i < n; ++i)
      mesh.add_face(geometry::FaceKind::quad4, std::vector<std::uint32_t>{at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
  return mesh;
}

// Computes nothing: answers with numbers of the right shape.
class Idle final : public protocol::Participant {
 public:
  Idle(std::string surface, std::vector<std::string> sends, std::uint32_t n) : surface_(std::move(surface)), sends_(std::move(sends)), mesh_(square(n, 0)) {}
  protocol::Introduction introduce() const override { return {"idle", 3, {}}; }
  std::vector<protocol::Surface> start(const protocol::Run&) override { return {{surface_, mesh_, {}, {}, {}}}; }
  protocol::Advance advance(const protocol::Window&, const std::vector<protocol::Field>&) override {
    protocol::Advance advance;
    for (const auto& name : sends_) advance.fields.push_back({surface_, name, std::vector<Vec3>(mesh_.points.size(), Vec3(0, 0, 1))});
    return advance;
  }

 private:
  std::string surface_;
  std::vector<std::string> sends_;
  geometry::SurfaceMesh mesh_;
};

// Sweeps over memory as a solver does, for so long.
void compute_for(double seconds) {
  thread_local std::vector<double> field(2'000'000, 1.0);
  for (const auto begin = Clock::now(); seconds_since(begin) < seconds;)
    for (auto& value : field) value = 0.5 * value + 1;
}

// One exchange of a hub with each of two, of the same bytes as a window's, and nothing else.
// @param work  of each of the two before it answers [s], which is not counted
double ping_pongs(std::size_t points, std::int64_t rounds, double work = 0) {
  static int runs = 0;
  zmq::context_t context;
  const auto endpoint = fmt::format("ipc:///tmp/acopla-pingpong-{}-{}", getpid(), ++runs);
  const std::size_t one = 24 * points;
  zmq::socket_t hub(context, ZMQ_ROUTER);
  hub.bind(endpoint);
  std::atomic<double> worked{0};  // the two take turns
  const auto answer = [&](const char* name, int arrays) {
    return std::thread([&, name, arrays] {
      zmq::socket_t socket(context, ZMQ_DEALER);
      socket.set(zmq::sockopt::routing_id, name);
      socket.connect(endpoint);
      socket.send(zmq::message_t("hello", 5), zmq::send_flags::none);
      for (std::int64_t k = 0; k < rounds; ++k) {
        zmq::message_t frame;
        do {
          (void)socket.recv(frame);
        } while (frame.more());
        if (work > 0) {
          const auto begin = Clock::now();
          compute_for(work);
          worked = worked + seconds_since(begin);
        }
        for (int a = 0; a < arrays; ++a) socket.send(zmq::message_t(one), a + 1 < arrays ? zmq::send_flags::sndmore : zmq::send_flags::none);
      }
    });
  };
  auto first = answer("first", 1), second = answer("second", 2);
  for (int k = 0; k < 2; ++k) {
    zmq::message_t frame;
    do {
      (void)hub.recv(frame);
    } while (frame.more());
  }
  const auto exchange = [&](const char* name, int arrays) {
    hub.send(zmq::message_t(name, std::strlen(name)), zmq::send_flags::sndmore);
    for (int a = 0; a < arrays; ++a) hub.send(zmq::message_t(one), a + 1 < arrays ? zmq::send_flags::sndmore : zmq::send_flags::none);
    zmq::message_t frame;
    do {
      (void)hub.recv(frame);
    } while (frame.more());
  };
  const auto begin = Clock::now();
  for (std::int64_t k = 0; k < rounds; ++k) {
    exchange("first", 2);
    exchange("second", 1);
  }
  const double seconds = seconds_since(begin);
  first.join();
  second.join();
  return (seconds - worked) / static_cast<double>(rounds);
}

void overhead(std::size_t vertices, std::int64_t windows) {
  const auto n = static_cast<std::uint32_t>(std::lround(std::sqrt(static_cast<double>(vertices))) - 1);
  const std::size_t points = (n + 1) * (n + 1);
  for (int turn = 0; turn < 7; ++turn) {
    Idle first("spring", {"force"}, n), second("mass", {"displacement", "velocity"}, n);
    const double bare = ping_pongs(points, windows);
    const auto coupled = run(0.5, windows, "scheme = \"explicit\"", first, second, "ipc");
    fmt::print("{{\"vertices\": {}, \"window\": {:.6g}, \"bare\": {:.6g}}}\n", points, coupled.seconds / static_cast<double>(windows), bare);
  }
}

// Bare messages between those that compute in between, and hot ones.
void waking(std::size_t points, double work) {
  fmt::print("{{\"cold\": {:.6g}, \"hot\": {:.6g}}}\n", ping_pongs(points, 100, work), ping_pongs(points, 1000));
}

std::size_t resident_bytes() {
  std::size_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages >> pages;
  return pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

// Notes the memory of the process at a tenth of the run, when everything has been needed once, and at its end.
class Scales final : public in_process::Door {
 public:
  void progress(std::int64_t window, std::int64_t windows, double, double) override {
    if (window == windows / 10) early = resident_bytes();
    if (window == windows) late = resident_bytes();
  }
  std::size_t early = 0, late = 0;
};

// Coupler and two participants in one process, with all that a run writes or nothing.
void long_run(std::int64_t windows, bool recorded) {
  Idle first("spring", {"force"}, 1), second("mass", {"displacement", "velocity"}, 1);
  const auto results = std::filesystem::temp_directory_path() / fmt::format("acopla-long-{}", getpid());
  std::filesystem::create_directories(results);
  Scales scales;
  const auto outcome = in_process::run(case_text(1, windows, "scheme = \"explicit\""), {{"first", &first}, {"second", &second}}, "inproc://long", scales,
                                       recorded ? results.string() : "");
  std::filesystem::remove_all(results);
  fmt::print("{{\"windows\": {}, \"met\": {}, \"early\": {}, \"late\": {}, \"seconds\": {:.4g}}}\n", windows, outcome.error ? "false" : "true", scales.early,
             scales.late, outcome.seconds);
}

void mapping(std::size_t vertices, coupler::MappingKind kind) {
  const auto n = static_cast<std::uint32_t>(std::lround(std::sqrt(static_cast<double>(vertices))) - 1);
  const auto from = square(n, 1e-3), to = square(n - 7, 0);
  auto begin = Clock::now();
  const coupler::Mapping mapping(from, to, {0.1, kind});
  const double build = seconds_since(begin);
  std::vector<Vec3> sent(from.points.size(), Vec3(1, 2, 3)), arrived(to.points.size());
  std::vector<double> times;
  for (int k = 0; k < 9; ++k) {
    begin = Clock::now();
    mapping.forces(sent, arrived);
    times.push_back(seconds_since(begin));
  }
  std::sort(times.begin(), times.end());
  fmt::print("{{\"vertices\": {}, \"build\": {:.6g}, \"apply\": {:.6g}}}\n", from.points.size(), build, times[4]);
}

}  // namespace

int main(int argc, char** argv) {
  mallopt(M_MMAP_THRESHOLD, 256 << 20);  // as acopla-coupler does; for both sides of the comparison
  mallopt(M_TRIM_THRESHOLD, 256 << 20);
  const std::string mode = argc > 1 ? argv[1] : "";
  if (mode == "orders") orders();
  else if (mode == "map") map(argc > 2 && std::string(argv[2]) == "--coarse");
  else if (mode == "overhead" && argc > 3) overhead(std::stoull(argv[2]), std::stoll(argv[3]));
  else if (mode == "waking" && argc > 3) waking(std::stoull(argv[2]), std::stod(argv[3]));
  else if (mode == "long" && argc > 2) long_run(std::stoll(argv[2]), argc > 3);
  else if (mode == "mapping" && argc > 2) mapping(std::stoull(argv[2]), argc > 3 ? coupler::MappingKind::overlap : coupler::MappingKind::conservative);
  else {
    fmt::print(stderr, "coupling orders | map [--coarse] | overhead VERTICES WINDOWS | waking VERTICES SECONDS | long WINDOWS [--recorded] | mapping VERTICES [--overlap]\n");
    return 2;
  }
  return 0;
}
