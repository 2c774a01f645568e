// How a wall moves: what its case says, as positions and velocities that are exact derivatives of them.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "dem/contact/vector.h"

namespace acopla::dem {

/// Where a rigid wall is and how it moves. A point of the wall that the case puts at x₀ is at
/// x = centre + displacement + R(axis, angle) (x₀ − centre) and moves at velocity + rate axis × (x − centre − displacement).
struct Placement {
  Vec3 displacement = Vec3::Zero();  ///< [m]
  Vec3 velocity = Vec3::Zero();      ///< d displacement / dt [m/s]
  double angle = 0;                  ///< about the axis [rad]
  double rate = 0;                   ///< d angle / dt [rad/s]
};

/// When something moves: from `start` to `stop`, speeding up over `ramp` after start and slowing down over `ramp` after stop [s].
struct Timing {
  double start = 0, stop = std::numeric_limits<double>::infinity(), ramp = 0;
};

/// A wall that is driven along a direction until the particles push back with a force.
struct Servo {
  Vec3 direction = Vec3::UnitZ();  ///< unit
  double force = 0;                ///< that pushes the wall along the direction, and that the particles answer at rest [N]
  double gain = 0;                 ///< speed for a missing force [m/(N s)]; 0: a plate of `mass` instead
  double mass = 0;                 ///< of the plate [kg]
  double damping = 0;              ///< of the plate [N s/m]
  double max_speed = 0;            ///< [m/s]
  double start = 0;                ///< stands until then [s]
};

/// The motion of one wall. A value; what changes with time (a servo's state, what a coupled solver prescribes) is the WallSet's.
class Motion {
 public:
  enum class Kind : std::uint8_t { fixed, translation, path, rotation, vibration, servo, prescribed };

  Motion() = default;  ///< fixed
  static Motion translation(const Vec3& velocity, const Timing& timing = {});
  /// @param speed  [rad/s], right-handed about the axis; @param axis  of any length
  static Motion rotation(const Vec3& centre, const Vec3& axis, double speed, const Timing& timing = {});
  /// displacement = amplitude e(t) sin(2π f (t − start) + phase); e, from 0 to 1 over the ramp and back after stop, is once continuously
  /// differentiable. The wall's place in the case is the middle.
  static Motion vibration(const Vec3& amplitude, double frequency, double phase, const Timing& timing = {});
  /// The same as a rotation by amplitude [rad] about an axis.
  static Motion turning_vibration(const Vec3& centre, const Vec3& axis, double amplitude, double frequency, double phase,
                                  const Timing& timing = {});
  /// Through displacements and angles at given times (ascending, two or more; either list may be empty); at rest before and after.
  /// @param smooth  by a C¹ cubic (finite-difference slopes, zero at both ends) instead of straight lines
  static Motion path(std::vector<double> times, std::vector<Vec3> displacements, std::vector<double> angles, const Vec3& centre,
                     const Vec3& axis, bool smooth);
  static Motion servo(const Servo& servo);
  /// Vertices moved by a coupled solver (WallSet::prescribe).
  static Motion prescribed();

  Kind kind() const { return kind_; }
  bool moves() const { return kind_ != Kind::fixed; }
  /// The wall may turn as a rigid body.
  bool turns() const { return turns_; }
  const Vec3& centre() const { return centre_; }
  const Vec3& axis() const { return axis_; }  ///< unit
  const Servo& servo() const { return servo_; }
  /// Where the wall is at a time; not for servos and prescribed motion, which have no place of their own.
  Placement at(double time) const;

 private:
  Kind kind_ = Kind::fixed;
  bool turns_ = false, smooth_ = false;
  Vec3 centre_ = Vec3::Zero(), axis_ = Vec3::UnitZ();
  Vec3 amplitude_ = Vec3::Zero();     // velocity of a translation; amplitude of a vibration
  double angle_ = 0;                  // speed of a rotation; amplitude of a turning vibration
  double frequency_ = 0, phase_ = 0;  // [rad/s], [rad]
  Timing timing_;
  std::vector<double> times_, angles_;
  std::vector<Vec3> displacements_;
  Servo servo_;
};

}  // namespace acopla::dem
