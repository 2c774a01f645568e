// Which diameters the particles have.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "dem/feeding/random.h"

namespace acopla::dem {

/// What a law of sizes weighs: how many particles of a diameter there are, or how much they weigh together.
enum class By { number, mass };

/// Some of the particles, all of one diameter (tables of Gomes 2014).
struct SizeGroup {
  double diameter = 0;  ///< [m]
  std::size_t count = 0;
};

/// The particles between two neighbouring sieves.
struct SieveClass {
  double low = 0, high = 0;  ///< openings [m]: held by `low`, through `high`
  double mass = 0;           ///< of them all, in any unit that is the same for all classes
};

/// Diameters from one up to another, by number. Held as a table of the cumulative number over 4096 steps equal in ln d.
class DiameterLaw {
 public:
  explicit DiameterLaw(double diameter, int dimension);
  /// @param density  number per metre of diameter, up to a factor, ≥ 0 and not zero everywhere in [low, high]
  DiameterLaw(double low, double high, int dimension, const std::function<double(double)>& density);

  /// The diameter that the fraction u of the particles does not exceed [m]; 0 ≤ u ≤ 1.
  double quantile(double u) const;
  double smallest() const { return diameter_.front(); }
  double largest() const { return diameter_.back(); }
  double mean_volume() const { return mean_volume_; }  ///< of a particle [m³]

 private:
  std::vector<double> diameter_, cumulative_;
  double mean_volume_ = 0;
};

/// A distribution of diameters: one class, or several whose shares of the volume are kept. Sampled by quota: a class gets
/// the whole number of particles nearest to its share, one in each equal part of its law. Where the volume of a class is
/// set, the ranks u in it become u^p with the one p that makes its volume exact. Results come in random order.
class SizeDistribution {
 public:
  static SizeDistribution one(double diameter, int dimension);
  static SizeDistribution groups(const std::vector<SizeGroup>& groups, int dimension);
  /// Sieve curve by mass (Nasato 2011, table 5-1). Within a class the mass is uniform in ln d, a straight line in the usual
  /// half-logarithmic plot; the number then goes with d^−4 (with d^−3 for discs).
  static SizeDistribution sieved(const std::vector<SieveClass>& classes, int dimension);
  static SizeDistribution uniform(double low, double high, By by, int dimension);
  /// Normal with its tails cut at the limits; the moments of the whole normal are the arguments.
  static SizeDistribution normal(double mean, double deviation, double low, double high, By by, int dimension);
  /// ln d normal about ln(median), with its tails cut at the limits. @param deviation  of ln d
  static SizeDistribution lognormal(double median, double deviation, double low, double high, By by, int dimension);

  /// Radii of so many particles [m].
  std::vector<double> draw(std::size_t count, Random& random) const;
  /// Radii of particles whose volumes add up to `volume` [m³]: exactly where diameters vary within a class, to half of the
  /// smallest particle where all are given. Each class is within a half of its own particle, plus a half of the next larger's
  /// where single diameters do not fit in evenly. Empty below half a particle.
  std::vector<double> draw_volume(double volume, Random& random) const;
  /// One radius [m], for a feed that goes on: from the class that lags most behind its share (Sainte-Laguë's divisors).
  /// @param delivered  volume of each class so far [m³], updated; start with an empty vector
  double draw_next(std::vector<double>& delivered, Random& random) const;

  int dimension() const { return dimension_; }
  double smallest_radius() const;
  double largest_radius() const;
  double mean_volume() const;  ///< of a particle, by number [m³]
  /// Sum of the counts of groups(); 0 for the others.
  std::size_t own_count() const { return own_count_; }

 private:
  struct Class {
    DiameterLaw law;
    double share;  // of the volume; all add up to 1
  };
  SizeDistribution(std::vector<Class> classes, int dimension);
  std::vector<double> draw_class(const Class& of, std::size_t count, double volume, Random& random) const;
  int dimension_;
  std::size_t own_count_ = 0;
  std::vector<Class> classes_;  // larger diameters first
};

}  // namespace acopla::dem
