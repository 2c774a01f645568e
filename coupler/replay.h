// A recorded participant that plays again what it sent.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "coupler/case.h"
#include "io/series.h"
#include "protocol/participant.h"

namespace acopla::coupler {

/// Plays the surfaces of one participant from an interface.h5: the time [at, at + to − from] of the
/// run is the recorded time [from, to]; outside it the forces are zero, and what moved stands still. A window that is a recorded
/// one gets its forces bit for bit; any other gets the mean of the recorded means over it. Motion is that at a window's end, between two recorded instants
/// on a straight line.
class Replay final : public protocol::Participant {
 public:
  /// @param name  of the participant that it stands for
  /// @throws io::UserError when the record cannot be read or does not hold what is asked
  Replay(const ReplayCase& replay, const std::string& name);

  protocol::Introduction introduce() const override;
  std::vector<protocol::Surface> start(const protocol::Run& run) override;
  protocol::Advance advance(const protocol::Window& window,
                            const std::vector<protocol::Field>& received) override;

 private:
  std::string owner() const;
  std::vector<geometry::Vec3> mean_force(const std::string& surface, std::size_t points,
                                         double start, double end) const;

  /// A field of motion at a time of the record.
  std::vector<geometry::Vec3> motion(const std::string& surface, const std::string& field, double time) const;

  struct Played {
    std::string surface;
    bool sends = false, moves = false, speeds = false;
  };
  ReplayCase replay_;
  std::string name_;
  io::SeriesReader reader_;
  std::vector<protocol::Surface> surfaces_;
  std::vector<Played> played_;  // the same
  std::string owner_;
  double from_ = 0, to_ = 0;  // [s], of the record
};

}  // namespace acopla::coupler
