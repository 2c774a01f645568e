// Where the energy of a scene is, and where it went. Kept only where the case asks for it (`energy = true`).
#pragma once

#include "dem/contact/model.h"

namespace acopla::dem {

/// All in joules (per metre of depth in 2D). What is lost is counted from the start of the run.
struct Energy {
  double kinetic = 0, gravity = 0;                      ///< Σ m v²/2 + I ω²/2; −Σ m g·x
  double normal = 0, tangential = 0, rolling = 0;       ///< in the springs of the contacts
  double lost_normal = 0, lost_sliding = 0, lost_rolling = 0;  ///< to normal dashpots; to friction and its dashpots; to rolling resistance
  double lost_damping = 0;                              ///< to damping beyond the contacts
  double wall_work = 0;                                 ///< done by moving walls
  double added = 0;                                     ///< brought by particles that came, less what the removed ones took along
  /// What the steps made or lost beyond all these: 0 for exact integration.
  double drift = 0;
  /// The largest loss below zero: friction, dashpots or damping that gave energy [J].
  double made = 0;
  /// The larger of |drift| and made, over the largest energy that was ever stored or had been lost.
  double relative_drift = 0;

  double stored() const { return kinetic + gravity + normal + tangential + rolling; }
  double lost() const { return lost_normal + lost_sliding + lost_rolling + lost_damping; }
};

/// Integrates powers over the steps by the trapezoidal rule.
class EnergyLedger {
 public:
  /// One step: the contacts as they are at its end.
  void step(const ContactEnergy<double>& now, double damping_power, double wall_power, double seconds);
  void add(double energy) { sums_.added += energy; }
  /// The balance now. @param kinetic, gravity  of the particles [J]
  Energy balance(double kinetic, double gravity);

  template <class Archive>
  void state(Archive& archive) {
    archive("sums", sums_);
    archive("now", now_);
    archive("tangential_work", tangential_work_);
    archive("rolling_work", rolling_work_);
    archive("last", last_);
    archive("start", start_);
    archive("scale", scale_);
    archive("started", started_);
  }

 private:
  struct Powers {
    double normal = 0, damping = 0, walls = 0;
  };
  Energy sums_;  // its integrals
  ContactEnergy<double> now_;
  double tangential_work_ = 0, rolling_work_ = 0;
  Powers last_;
  double start_ = 0, scale_ = 0;
  bool started_ = false;
};

}  // namespace acopla::dem
