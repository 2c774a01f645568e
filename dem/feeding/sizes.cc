#include "dem/feeding/sizes.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "dem/feeding/region.h"

namespace acopla::dem {
namespace {

double volume_of_diameter(double diameter, int dimension) { return particle_volume(diameter / 2, dimension); }

// Turns a density by mass into the one by number.
double per_particle(By by, double diameter, int dimension) { return by == By::number ? 1 : std::pow(diameter, -dimension); }

// exp(−z²/2), scaled by its largest value in the limits, so that limits far out in a tail do not end in 0/0.
double cut_normal(double z, double low, double high) {
  const double nearest = std::clamp(0.0, low, high);
  return std::exp((nearest * nearest - z * z) / 2);
}

}  // namespace

DiameterLaw::DiameterLaw(double diameter, int dimension)
    : diameter_{diameter}, cumulative_{1}, mean_volume_(volume_of_diameter(diameter, dimension)) {}

DiameterLaw::DiameterLaw(double low, double high, int dimension, const std::function<double(double)>& density) {
  constexpr int steps = 4096;
  const double step = std::log(high / low) / steps;
  const auto node = [&](double k) { return k <= 0 ? low : k >= steps ? high : low * std::exp(k * step); };
  // Per ln d; Simpson's rule in every step.
  const auto number = [&](double d) { return d * density(d); };
  const auto simpson = [](double a, double m, double b) { return (a + 4 * m + b) / 6; };
  double total = 0, volume = 0;
  diameter_.push_back(low);
  cumulative_.push_back(0);
  for (int k = 0; k < steps; ++k) {
    const double d[] = {node(k), node(k + 0.5), node(k + 1)};
    const double n[] = {number(d[0]), number(d[1]), number(d[2])};
    total += simpson(n[0], n[1], n[2]);
    volume += simpson(n[0] * volume_of_diameter(d[0], dimension), n[1] * volume_of_diameter(d[1], dimension),
                      n[2] * volume_of_diameter(d[2], dimension));
    diameter_.push_back(d[2]);
    cumulative_.push_back(total);
  }
  for (auto& value : cumulative_) value /= total;
  cumulative_.back() = 1;
  mean_volume_ = volume / total;
}

double DiameterLaw::quantile(double u) const {
  const auto above = std::lower_bound(cumulative_.begin(), cumulative_.end(), u);
  if (above == cumulative_.begin()) return diameter_.front();
  if (above == cumulative_.end()) return diameter_.back();
  const auto k = static_cast<std::size_t>(above - cumulative_.begin());
  const double part = (u - cumulative_[k - 1]) / (cumulative_[k] - cumulative_[k - 1]);
  return std::min(diameter_[k], diameter_[k - 1] + part * (diameter_[k] - diameter_[k - 1]));
}

SizeDistribution::SizeDistribution(std::vector<Class> classes, int dimension) : dimension_(dimension), classes_(std::move(classes)) {
  std::erase_if(classes_, [](const Class& one) { return !(one.share > 0); });
  double total = 0;
  for (const auto& one : classes_) total += one.share;
  for (auto& one : classes_) one.share /= total;
  std::stable_sort(classes_.begin(), classes_.end(), [](const Class& a, const Class& b) { return a.law.largest() > b.law.largest(); });
}

SizeDistribution SizeDistribution::one(double diameter, int dimension) {
  return SizeDistribution({{DiameterLaw(diameter, dimension), 1.0}}, dimension);
}

SizeDistribution SizeDistribution::groups(const std::vector<SizeGroup>& groups, int dimension) {
  std::vector<Class> classes;
  std::size_t count = 0;
  for (const auto& group : groups) {
    DiameterLaw law(group.diameter, dimension);
    classes.push_back({law, static_cast<double>(group.count) * law.mean_volume()});
    count += group.count;
  }
  SizeDistribution sizes(std::move(classes), dimension);
  sizes.own_count_ = count;
  return sizes;
}

SizeDistribution SizeDistribution::sieved(const std::vector<SieveClass>& sieves, int dimension) {
  std::vector<Class> classes;
  for (const auto& sieve : sieves)
    if (sieve.mass > 0)
      classes.push_back(
          {DiameterLaw(sieve.low, sieve.high, dimension, [&](double d) { return std::pow(d / sieve.low, -1 - dimension); }), sieve.mass});
  return SizeDistribution(std::move(classes), dimension);
}

SizeDistribution SizeDistribution::uniform(double low, double high, By by, int dimension) {
  return SizeDistribution({{DiameterLaw(low, high, dimension, [&](double d) { return per_particle(by, d / low, dimension); }), 1.0}},
                          dimension);
}

SizeDistribution SizeDistribution::normal(double mean, double deviation, double low, double high, By by, int dimension) {
  const auto z = [&](double d) { return (d - mean) / deviation; };
  const auto density = [&](double d) { return cut_normal(z(d), z(low), z(high)) * per_particle(by, d / low, dimension); };
  return SizeDistribution({{DiameterLaw(low, high, dimension, density), 1.0}}, dimension);
}

SizeDistribution SizeDistribution::lognormal(double median, double deviation, double low, double high, By by, int dimension) {
  const auto z = [&](double d) { return std::log(d / median) / deviation; };
  const auto density = [&](double d) { return cut_normal(z(d), z(low), z(high)) / d * per_particle(by, d / low, dimension); };
  return SizeDistribution({{DiameterLaw(low, high, dimension, density), 1.0}}, dimension);
}

double SizeDistribution::smallest_radius() const {
  double smallest = classes_.front().law.smallest();
  for (const auto& one : classes_) smallest = std::min(smallest, one.law.smallest());
  return smallest / 2;
}

double SizeDistribution::largest_radius() const { return classes_.front().law.largest() / 2; }

double SizeDistribution::mean_volume() const {
  double particles = 0;  // in a unit of volume
  for (const auto& one : classes_) particles += one.share / one.law.mean_volume();
  return 1 / particles;
}

std::vector<double> SizeDistribution::draw(std::size_t count, Random& random) const {
  // Whole numbers in proportion, the rest to the largest remainders.
  std::vector<std::size_t> numbers(classes_.size());
  std::vector<std::pair<double, std::size_t>> remainders;
  const double volume = static_cast<double>(count) * mean_volume();
  std::size_t given = 0;
  for (std::size_t c = 0; c < classes_.size(); ++c) {
    // A hair more, for the shares of groups whose counts are whole: 3750 must not become 3749.9999 and lose its one.
    const double ideal = classes_[c].share * volume / classes_[c].law.mean_volume() * (1 + 1e-12);
    numbers[c] = std::min(static_cast<std::size_t>(ideal), count - given);
    given += numbers[c];
    remainders.emplace_back(static_cast<double>(numbers[c]) - ideal, c);
  }
  std::sort(remainders.begin(), remainders.end());
  for (std::size_t k = 0; given < count; ++k, ++given) ++numbers[remainders[k % remainders.size()].second];
  std::vector<double> radii;
  for (std::size_t c = 0; c < classes_.size(); ++c) {
    const double target = classes_.size() > 1 ? classes_[c].share * volume : 0;
    const auto drawn = draw_class(classes_[c], numbers[c], target, random);
    radii.insert(radii.end(), drawn.begin(), drawn.end());
  }
  random.shuffle(radii);
  return radii;
}

std::vector<double> SizeDistribution::draw_volume(double volume, Random& random) const {
  std::vector<double> radii;
  double carried = 0;  // what the larger classes could not place in whole particles
  for (const auto& one : classes_) {
    const double target = std::max(0.0, one.share * volume + carried);
    // The number nearest to the law's among those that can have this volume together.
    const double fewest = std::ceil(target / volume_of_diameter(one.law.largest(), dimension_) * (1 - 1e-12));
    const double most = std::floor(target / volume_of_diameter(one.law.smallest(), dimension_) * (1 + 1e-12));
    double number = std::round(target / one.law.mean_volume());
    if (fewest <= most) number = std::clamp(number, fewest, most);
    const auto drawn = draw_class(one, static_cast<std::size_t>(number), target, random);
    carried = one.share * volume + carried;
    for (const double radius : drawn) carried -= particle_volume(radius, dimension_);
    radii.insert(radii.end(), drawn.begin(), drawn.end());
  }
  random.shuffle(radii);
  return radii;
}

double SizeDistribution::draw_next(std::vector<double>& delivered, Random& random) const {
  delivered.resize(classes_.size());
  std::size_t next = 0;
  double lag = 0;
  for (std::size_t c = 0; c < classes_.size(); ++c) {
    const double quotient = classes_[c].share / (delivered[c] + classes_[c].law.mean_volume() / 2);
    if (quotient > lag) {
      lag = quotient;
      next = c;
    }
  }
  const double radius = classes_[next].law.quantile(random.uniform()) / 2;
  delivered[next] += particle_volume(radius, dimension_);
  return radius;
}

// @param volume  of all of them, met as nearly as the limits of the class allow; 0 where it is free
std::vector<double> SizeDistribution::draw_class(const Class& of, std::size_t count, double volume, Random& random) const {
  std::vector<double> ranks(count), radii(count);
  for (std::size_t k = 0; k < count; ++k) ranks[k] = (static_cast<double>(k) + random.uniform()) / static_cast<double>(count);
  // Radii for p = e^q; returns their relative excess of volume, which falls with q.
  const auto excess = [&](double q) {
    const double power = std::exp(q);
    double sum = 0;
    for (std::size_t k = 0; k < count; ++k) {
      radii[k] = of.law.quantile(q == 0 ? ranks[k] : std::pow(ranks[k], power)) / 2;
      sum += particle_volume(radii[k], dimension_);
    }
    return volume > 0 ? sum / volume - 1 : 0;
  };
  constexpr double exact = 1e-14;
  double left = 0, at_left = excess(0);
  if (count == 0 || std::abs(at_left) <= exact || of.law.smallest() == of.law.largest()) return radii;
  // Bracket, then regula falsi with halving (Illinois).
  const double direction = at_left > 0 ? 1 : -1;
  double right = 0, at_right = at_left;
  for (double reach = 1e-3; at_right * at_left > 0 && reach < 1e3; reach *= 4) at_right = excess(right = direction * reach);
  if (at_right * at_left > 0) return radii;  // all at the limit of the class
  for (int iteration = 0; iteration < 200 && std::abs(right - left) > 1e-16; ++iteration) {
    const double middle = right - at_right * (right - left) / (at_right - at_left);
    const double at_middle = excess(middle);
    if (std::abs(at_middle) <= exact) return radii;
    if (at_middle * at_right < 0) {
      left = right;
      at_left = at_right;
    } else {
      at_left /= 2;
    }
    right = middle;
    at_right = at_middle;
  }
  return radii;
}

}  // namespace acopla::dem
