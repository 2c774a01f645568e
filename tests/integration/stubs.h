// Two small participants with known forces: a sender on a triangulated square, a receiver on a
// coarser square of quads.
#pragma once

#include <chrono>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "io/error.h"
#include "protocol/participant.h"

namespace acopla::stubs {

using geometry::Vec3;

/// The unit square at height z, n × n cells, as triangles or quads.
inline geometry::SurfaceMesh square(std::uint32_t n, bool triangles, double z = 0) {
  geometry::SurfaceMesh mesh;
  for (std::uint32_t j = 0; j <= n; ++j)
    for (std::uint32_t i = 0; i <= n; ++i)
      mesh.points.emplace_back(double(i) / n, double(j) / n, z);
  const auto at = [&](std::uint32_t i, std::uint32_t j) { return j * (n + 1) + i; };
  for (std::uint32_t j = 0; j < n; ++j)
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::vector<std::uint32_t> quad{at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)};
      if (!triangles) {
        mesh.add_face(geometry::FaceKind::quad4, quad);
        continue;
      }
      mesh.add_face(geometry::FaceKind::triangle3,
                    std::vector<std::uint32_t>{quad[0], quad[1], quad[2]});
      mesh.add_face(geometry::FaceKind::triangle3,
                    std::vector<std::uint32_t>{quad[0], quad[2], quad[3]});
    }
  return mesh;
}

/// The force of window k on point p: irregular, so that a mistaken window or point shows.
inline Vec3 known_force(std::int64_t window, std::size_t point) {
  const double k = static_cast<double>(window), p = static_cast<double>(point);
  return {std::sin(1 + k + 0.7 * p), std::cos(2 + 0.3 * k * p), -1 - std::sin(0.1 * k + p)};
}

/// What goes wrong, and when.
struct Mishap {
  std::int64_t window = -1;  ///< −1: never
  enum class Kind {
    none,
    exception,
    user_error,
    hang,
    die,
    not_finite,
    forget_force,
    wrong_size
  } kind = Kind::none;
};

inline void suffer(const Mishap& mishap, std::int64_t window) {
  if (mishap.window != window) return;
  switch (mishap.kind) {
    case Mishap::Kind::exception:
      throw std::runtime_error("the stub was told to fail");
    case Mishap::Kind::user_error:
      throw io::UserError({"case.toml", 7, 3}, "stub.key = 3 is wrong. Use 4.");
    case Mishap::Kind::hang:
      std::this_thread::sleep_for(std::chrono::hours(1));
      break;
    case Mishap::Kind::die:
      std::_Exit(7);
    default:
      break;
  }
}

class Sender : public protocol::Participant {
 public:
  std::chrono::milliseconds pause{0};
  Mishap mishap;
  double height = 0.01;

  protocol::Introduction introduce() const override { return {"stub", 3, {}}; }
  std::vector<protocol::Surface> start(const protocol::Run& run) override {
    run_ = run;
    surface_ = square(7, true, height);
    return {{"box", surface_}};
  }
  protocol::Advance advance(const protocol::Window& window,
                            const std::vector<protocol::Field>&) override {
    std::this_thread::sleep_for(pause);
    suffer(mishap, window.start);
    protocol::Advance advance;
    protocol::Field field{"box", "force", {}};
    Vec3 sum = Vec3::Zero();
    for (std::size_t p = 0; p < surface_.points.size(); ++p) {
      field.values.push_back(known_force(window.start, p));
      sum += field.values.back();
    }
    if (mishap.window == window.start && mishap.kind == Mishap::Kind::not_finite)
      field.values[3][1] = std::nan("");
    if (mishap.window == window.start && mishap.kind == Mishap::Kind::wrong_size)
      field.values.pop_back();
    advance.quantities = {{"box.force.z", sum[2]}};
    if (mishap.window != window.start || mishap.kind != Mishap::Kind::forget_force)
      advance.fields.push_back(std::move(field));
    advance.steps = 10;
    return advance;
  }

  const protocol::Run& run() const { return run_; }

 private:
  protocol::Run run_;
  geometry::SurfaceMesh surface_;
};

class Receiver : public protocol::Participant {
 public:
  std::chrono::milliseconds pause{0};
  Mishap mishap;
  struct Got {
    protocol::Window window;
    std::vector<Vec3> force;
  };
  std::vector<Got> got;  ///< what it was given, window by window

  protocol::Introduction introduce() const override { return {"stub", 3, {}}; }
  std::vector<protocol::Surface> start(const protocol::Run& run) override {
    run_ = run;
    return {{"inside", square(4, false)}};
  }
  protocol::Advance advance(const protocol::Window& window,
                            const std::vector<protocol::Field>& received) override {
    std::this_thread::sleep_for(pause);
    suffer(mishap, window.start);
    Vec3 sum = Vec3::Zero();
    for (const auto& field : received) {
      got.push_back({window, field.values});
      for (const auto& f : field.values) sum += f;
    }
    protocol::Advance advance;
    advance.quantities = {{"reaction.z", -sum[2]}};
    advance.steps = 1;
    return advance;
  }
  std::vector<std::pair<std::string, double>> finish() override { return {{"seconds.solve", 0.5}}; }

  const protocol::Run& run() const { return run_; }

 private:
  protocol::Run run_;
};

}  // namespace acopla::stubs
