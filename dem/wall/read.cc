#include "dem/wall/read.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace acopla::dem {
namespace {

constexpr double degree = M_PI / 180;

class MotionReader {
 public:
  MotionReader(const io::Table& table, int dimension) : table_(table), dimension_(dimension) {}

  Motion read() const {
    const auto kind = table_.choice("kind", {"translation", "rotation", "vibration", "path", "servo"});
    if (kind == "translation") return Motion::translation(table_.vector("velocity", dimension_), timing());
    if (kind == "rotation") return rotation();
    if (kind == "vibration") return vibration();
    return kind == "path" ? path() : servo();
  }

 private:
  Timing timing() const {
    Timing timing;
    timing.start = table_.number("start", io::non_negative, 0);
    timing.ramp = table_.number("ramp", io::non_negative, 0);
    if (const auto stop = table_.optional_number("stop", io::non_negative)) {
      timing.stop = *stop;
      if (timing.stop < timing.start) table_.fail("stop", fmt::format("= {:.4g} s is before start = {:.4g} s.", timing.stop, timing.start));
    }
    return timing;
  }

  Vec3 direction(std::string_view key) const {
    const Vec3 vector = table_.vector(key, dimension_);
    if (!(vector.norm() > 0)) table_.fail(key, "has no length. Give a direction.");
    return vector.normalized();
  }

  // In the plane everything turns about the axis out of it.
  Vec3 axis() const {
    if (dimension_ == 3) return direction("axis");
    if (table_.has("axis")) table_.fail("axis", "is not wanted in two dimensions: everything turns counter-clockwise about centre. Remove it.");
    return Vec3::UnitZ();
  }

  Motion rotation() const {
    if (table_.has("rpm") == table_.has("speed")) table_.fail("needs exactly one of rpm [1/min] and speed [rad/s].");
    const double speed = table_.has("rpm") ? table_.number("rpm") * 2 * M_PI / 60 : table_.number("speed");
    return Motion::rotation(table_.vector("centre", dimension_), axis(), speed, timing());
  }

  Motion vibration() const {
    if (table_.has("amplitude") == table_.has("angle"))
      table_.fail("needs exactly one of amplitude [m], with direction, and angle [degrees], with centre" +
                  std::string(dimension_ == 3 ? " and axis." : "."));
    const double frequency = table_.number("frequency", io::positive), phase = table_.number("phase", io::any, 0) * degree;
    const auto times = timing();
    if (std::isfinite(times.stop) && times.ramp <= 0)
      table_.fail("stop", "needs a ramp [s] over which the vibration fades: without it the wall would jump to its middle.");
    if (table_.has("amplitude"))
      return Motion::vibration(table_.number("amplitude", io::positive) * direction("direction"), frequency, phase, times);
    return Motion::turning_vibration(table_.vector("centre", dimension_), axis(), table_.number("angle", io::positive) * degree, frequency, phase,
                                     times);
  }

  Motion path() const {
    const auto times = table_.numbers("times");
    if (times.size() < 2) table_.fail("times", "needs two or more times.");
    for (std::size_t k = 1; k < times.size(); ++k)
      if (!(times[k] > times[k - 1])) table_.fail("times", fmt::format("must ascend: {:.6g} follows {:.6g}.", times[k], times[k - 1]));
    if (!table_.has("displacements") && !table_.has("angles")) table_.fail("needs displacements [m] or angles [degrees], one a time.");
    std::vector<Vec3> displacements;
    std::vector<double> angles;
    const auto check = [&](const char* key, std::size_t size) {
      if (size != times.size()) table_.fail(key, fmt::format("has {} entries for {} times. Give one a time.", size, times.size()));
    };
    if (table_.has("displacements")) {
      displacements = table_.vectors("displacements", dimension_);
      check("displacements", displacements.size());
    }
    Vec3 centre = Vec3::Zero(), about = Vec3::UnitZ();
    if (table_.has("angles")) {
      angles = table_.numbers("angles");
      check("angles", angles.size());
      for (auto& angle : angles) angle *= degree;
      centre = table_.vector("centre", dimension_);
      about = axis();
    } else if (table_.has("centre") || table_.has("axis")) {
      table_.fail(table_.has("centre") ? "centre" : "axis", "has no effect without angles. Add angles or remove it.");
    }
    const bool smooth = table_.choice("interpolation", {"smooth", "linear"}, "smooth") == "smooth";
    return Motion::path(times, std::move(displacements), std::move(angles), centre, about, smooth);
  }

  Motion servo() const {
    Servo servo;
    servo.direction = direction("direction");
    servo.force = table_.number("force", io::positive);
    if (table_.has("gain") == table_.has("mass")) table_.fail("needs exactly one of gain [m/(N s)] and mass [kg].");
    servo.gain = table_.optional_number("gain", io::positive).value_or(0);
    servo.mass = table_.optional_number("mass", io::positive).value_or(0);
    if (servo.gain > 0 && table_.has("damping")) table_.fail("damping", "belongs to mass. Remove it, or give mass instead of gain.");
    servo.damping = table_.number("damping", io::non_negative, 0);
    servo.max_speed = table_.number("max_speed", io::positive);
    servo.start = table_.number("start", io::non_negative, 0);
    return Motion::servo(servo);
  }

  const io::Table& table_;
  int dimension_;
};

void read_plane(const io::Table& table, int dimension, Wall& wall) {
  const auto plane = table.table("plane");
  wall.is_plane = true;
  wall.point = plane.vector("point", dimension);
  wall.normal = plane.vector("normal", dimension);
  if (!(wall.normal.norm() > 0)) plane.fail("normal", "has no length. It points to the side of the particles.");
  wall.normal.normalize();
}

void read_line(const io::Table& table, Wall& wall) {
  wall.line = table.vectors("line", 2);
  wall.closed = table.flag("closed", false);
  const auto count = wall.line.size();
  if (count < 2) table.fail("line", "needs two or more corners, [[x, y], [x, y], …].");
  if (wall.closed && count < 3) table.fail("line", "needs three or more corners to be closed.");
  for (std::size_t k = 0; k < (wall.closed ? count : count - 1); ++k)
    if (const auto next = (k + 1) % count; wall.line[k] == wall.line[next])
      table.fail("line", fmt::format("has the corner ({:.6g}, {:.6g}) twice in a row.{}", wall.line[k][0], wall.line[k][1],
                                     wall.closed && next == 0 ? " A closed line returns to its first corner by itself." : " Remove one."));
}

}  // namespace

Wall read_wall(const io::Table& table, const std::string& name, const std::vector<std::string>& materials, int dimension) {
  Wall wall;
  wall.name = name;
  const auto material = table.choice("material", materials);
  wall.material = static_cast<std::uint8_t>(std::find(materials.begin(), materials.end(), material) - materials.begin());
  const char* const surface = dimension == 2 ? "line" : "mesh";
  const char* const other = dimension == 2 ? "mesh" : "line";
  if (table.has(other))
    table.fail(other, fmt::format("is for {} dimensions. Use plane or {}.", dimension == 2 ? "three" : "two", surface));
  if (table.has("plane") == table.has(surface)) table.fail(fmt::format("needs exactly one of plane and {}.", surface));
  if (table.has("plane")) read_plane(table, dimension, wall);
  else if (dimension == 2) read_line(table, wall);
  else wall.mesh = io::read_stl(table.path("mesh"));
  if (table.has("closed") && wall.line.empty()) table.fail("closed", "belongs to a line. Remove it.");
  if (table.has("glued")) {
    if (wall.is_plane) table.fail("glued", fmt::format("particles need a {} to stand on. A plane has no end.", surface));
    const auto glued = table.table("glued");
    wall.glued_diameter = glued.number("diameter", io::positive);
    wall.glued_spacing = glued.number("spacing", io::positive, wall.glued_diameter);
  }
  if (table.has("motion")) wall.motion = MotionReader(table.table("motion"), dimension).read();
  return wall;
}

}  // namespace acopla::dem
