// Two-way coupling: forces load the structures, whose motion moves the surfaces that sent them.
#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "coupler/acceleration/acceleration.h"
#include "coupler/acceleration/jump.h"
#include "coupler/account.h"
#include "coupler/case.h"
#include "coupler/crew.h"
#include "coupler/scheme.h"
#include "coupler/stability.h"
#include "coupler/window_span.h"

namespace acopla::coupler {

/// Loaders send forces and are moved; structures are loaded and send their motion. A window of length Δt from t_n, with the motion (u, v)
/// of the structures' surfaces:
///
/// - explicit: the loaders begin at u_n and move on with v_n; the structures get the mean of their forces. Order 2.
/// - parallel: the same, but both sides compute at once: the structures get the forces of the window before. Order 1, and unstable unless
///   the structure damps, so it is refused unless the case insists.
/// - implicit: the loaders move from (u_n, v_n) to an assumed (u_{n+1}, v_{n+1}), which is bettered until what the structures answer is the
///   same within the tolerances. Everybody returns to the window's start before each iteration but the first.
///
/// An explicit scheme is like central differences, however implicit the structure's own steps are: contacts of stiffness k and dashpot c on a
/// node of mass M = 1/(M⁻¹)_nn throw it away beyond (k Δt² + 2 c Δt)/M = 4 (derived in docs/theory.md). Where the participants say these numbers,
/// the root of the left side, ω_c Δt where nothing damps, is noted beyond 0.5, and refused beyond 1.
class TwoWay final : public Scheme {
 public:
  /// @throws io::UserError where nobody answers, or a surface would be moved by two
  TwoWay(const Case& read, Crew& crew, Account& account, Reporter& reporter);
  void step() override;
  void write(io::StateWriter& writer) override { state(writer); }
  void read(io::StateReader& reader) override { state(reader); }

 private:
  using Vectors = std::vector<geometry::Vec3>;
  /// Of one surface at one instant, in the order of its points.
  struct Motion {
    Vectors displacement, velocity;  ///< [m], [m/s]
  };
  using Motions = std::map<std::string, Motion>;  // of the structures' surfaces, "structure.inside"
  using Forces = std::map<std::string, Vectors>;  // on them [N]

  template <class Archive>
  void state(Archive& archive);
  void step_serially(WindowRecord& window);
  void step_in_parallel(WindowRecord& window);
  void step_with_iterations(WindowRecord& window);

  void begin_loaders(std::int64_t window, const Motions* end);
  bool estimates(std::int64_t window) const;
  void check_stability();
  void begin_next(std::int64_t window);
  void load(WindowRecord& window, Forces& forces, Motions& end);
  void begin_structures(Forces forces);
  void gather(std::size_t answers, WindowRecord& window, Forces& forces, Motions& motions);
  void balance(WindowRecord& window) const;
  /// The work of a window, and its motion where that is asked for. @param acting  whose forces loaded the structures
  void book(WindowRecord& window, const WindowRecord& acting, const Motions& start, const Motions& moved_to, const Motions& end) const;
  Motions moved_on(const Motions& start, double length) const;
  void carry(const Link& link, const Motions& motions, Motion& moved) const;
  double work_at_sender(const Link& link, const WindowRecord& window, const Motions& start, const Motions& moved_to) const;
  bool agree(const Forces& forces, const Forces& before, double& change) const;
  void give_up(const std::vector<double>& residuals, double force_change) const;

  Eigen::VectorXd flat(const Motions& motions) const;
  Motions unflat(const Eigen::VectorXd& values) const;

  const Case& case_;
  Crew& crew_;
  Account& account_;
  Reporter& reporter_;
  std::vector<std::string> loaders_, structures_;
  Motions now_;          // at the present window's start
  WindowRecord last_;    // parallel: the forces of the window before
  bool begun_ = false;   // explicit: the loaders are in the next window already
  std::unique_ptr<Acceleration> acceleration_;  // implicit only
  Jump jump_;
  std::int64_t window_ = 0;
  Stability stability_;
  WindowSpan span_;     // of the present window; one tick unless it is automatic
  bool saved_ = false;  // the loaders remember the present window's start
  bool warned_ = false, grows_ = false;
};

}  // namespace acopla::coupler
