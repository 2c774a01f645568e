#include "dem/feeding/fill.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dem/feeding/growth.h"

namespace acopla::dem {
namespace {

// Sites that touch a wall or each other exactly are not lost to round-off.
constexpr double touching = 1 - 1e-9;

double solid_volume(std::span<const double> radii, int dimension) {
  double volume = 0;
  for (const double radius : radii) volume += particle_volume(radius, dimension);
  return volume;
}

// Each filling has one stream for its places and one for its sizes, so that neither depends on the other fillings.
enum Purpose : std::uint64_t { places = 0, diameters = 1 };
Random stream(const Filling& filling, std::size_t index, Purpose purpose, const FillSettings& settings) {
  return filling.seed ? Random::stream(*filling.seed, purpose) : Random::stream(settings.seed, 2 * index + purpose);
}

std::string diameters_text(std::span<const double> radii) {
  const auto [least, most] = std::minmax_element(radii.begin(), radii.end());
  return *least == *most ? fmt::format("{:.4g} m", 2 * *most) : fmt::format("{:.4g} to {:.4g} m", 2 * *least, 2 * *most);
}

class Filler {
 public:
  Filler(std::span<const Filling> fillings, const FillSettings& settings)
      : fillings_(fillings), settings_(settings), occupancy_(settings.dimension, largest_radius()) {}

  std::vector<NewParticle> fill() {
    for (std::size_t k = 0; k < fillings_.size(); ++k) {
      radii_.push_back(radii_of(fillings_[k], k, settings_));
      at_.emplace_back(radii_[k].size());
    }
    const auto each = [&](Placing placing, auto place) {
      for (std::size_t k = 0; k < fillings_.size(); ++k)
        if (fillings_[k].placing == placing) (this->*place)(k);
    };
    each(Placing::given, &Filler::place_given);
    each(Placing::growth, &Filler::grow);
    each(Placing::lattice, &Filler::place_on_lattice);
    place_random();
    std::vector<NewParticle> particles;
    for (std::size_t k = 0; k < fillings_.size(); ++k) {
      const auto& filling = fillings_[k];
      if (filling.placing == Placing::given)
        particles.insert(particles.end(), filling.particles.begin(), filling.particles.end());
      else
        for (std::size_t i = 0; i < radii_[k].size(); ++i)
          particles.push_back({at_[k][i], radii_[k][i], filling.velocity, filling.spin, filling.material});
    }
    return particles;
  }

 private:
  double largest_radius() const {
    double largest = 0;
    for (const auto& filling : fillings_) largest = std::max(largest, filling.largest_radius());
    return largest;
  }

  bool is_free(const Vec3& at, double radius) const {
    return occupancy_.is_free(at, radius) && (!settings_.vacant || settings_.vacant(at, radius));
  }

  void place_given(std::size_t k) {
    for (const auto& particle : fillings_[k].particles) occupancy_.add(particle.at, particle.radius);
  }

  void grow(std::size_t k) {
    const auto& filling = fillings_[k];
    auto random = stream(filling, k, places, settings_);
    const auto packing = grow_packing(*filling.region, radii_[k], random);
    const double target = solid_volume(radii_[k], settings_.dimension) / filling.region->volume();
    if (packing.jammed)
      throw io::UserError(
          filling.where,
          fmt::format("{} of {:.4g} % solid cannot be packed into {}: growth jams at {:.4g} %. Random close "
                      "packing of equal {}s is near {} %, and less between near walls. Ask for at most {:.4g} %.",
                      filling.name, 100 * target, filling.region->text(), 100 * packing.solid_fraction, particle_word(settings_.dimension),
                      settings_.dimension == 2 ? 84 : 64, std::floor(1000 * packing.solid_fraction) / 10));
    at_[k] = packing.at;
    for (std::size_t i = 0; i < at_[k].size(); ++i)
      if (!is_free(at_[k][i], radii_[k][i]))
        throw io::UserError(filling.where,
                            fmt::format("{} grows in {}, where a wall or another insertion already is. Growth needs an empty "
                                        "region: move or shrink it.",
                                        filling.name, filling.region->text()));
    for (std::size_t i = 0; i < at_[k].size(); ++i) occupancy_.add(at_[k][i], radii_[k][i]);
  }

  void place_on_lattice(std::size_t k) {
    const auto& filling = fillings_[k];
    const auto sites = lattice_sites(
        *filling.region, filling.lattice, filling.largest_radius(), settings_.gravity,
        [&](const Vec3& at, double radius) { return is_free(at, radius * touching); }, radii_[k].size());
    if (sites.size() < radii_[k].size())
      throw io::UserError(filling.where,
                          fmt::format("only {} of {} {}s of {} find a site of the lattice in {}. Enlarge the region, lower the "
                                      "count or the spacing, or choose another lattice.",
                                      sites.size(), radii_[k].size(), particle_word(settings_.dimension), diameters_text(radii_[k]),
                                      filling.region->text()));
    auto random = stream(filling, k, places, settings_);
    for (std::size_t i = 0; i < sites.size(); ++i) {
      at_[k][i] = sites[i];
      if (filling.lattice.jitter > 0) {
        // A wall or another insertion may reach into the room around the site: then it stays.
        const Vec3 moved = jittered(sites[i], radii_[k][i], *filling.region, filling.lattice, random);
        if (is_free(moved, radii_[k][i])) at_[k][i] = moved;
      }
    }
    for (std::size_t i = 0; i < sites.size(); ++i) occupancy_.add(at_[k][i], radii_[k][i]);
  }

  void place_random() {
    std::vector<std::pair<std::size_t, std::size_t>> order;  // filling and its particle
    std::vector<Random> randoms;
    for (std::size_t k = 0; k < fillings_.size(); ++k) {
      randoms.push_back(stream(fillings_[k], k, places, settings_));
      if (fillings_[k].placing == Placing::random)
        for (std::size_t i = 0; i < radii_[k].size(); ++i) order.emplace_back(k, i);
    }
    const auto radius_of = [&](const auto& which) { return radii_[which.first][which.second]; };
    std::stable_sort(order.begin(), order.end(), [&](const auto& a, const auto& b) { return radius_of(a) > radius_of(b); });
    std::vector<std::size_t> placed(fillings_.size());
    for (const auto& [k, i] : order) {
      const auto& filling = fillings_[k];
      if (!place_at_random(*filling.region, radii_[k][i], occupancy_, settings_.vacant, randoms[k], placing_tries, at_[k][i]))
        no_room(k, placed[k]);
      occupancy_.add(at_[k][i], radii_[k][i]);
      ++placed[k];
    }
  }

  [[noreturn]] void no_room(std::size_t k, std::size_t placed) const {
    const auto& filling = fillings_[k];
    const int dimension = settings_.dimension;
    throw io::UserError(
        filling.where,
        fmt::format("only {} of {} {}s of {} find a place in {}: they would fill {:.0f} % of it, and random placing without overlap ends "
                    "near {} %. Enlarge the region or lower the count, or use place = \"growth\".",
                    placed, radii_[k].size(), particle_word(dimension), diameters_text(radii_[k]), filling.region->text(),
                    100 * solid_volume(radii_[k], dimension) / filling.region->volume(), dimension == 2 ? 50 : 30));
  }

  std::span<const Filling> fillings_;
  const FillSettings& settings_;
  Occupancy occupancy_;
  std::vector<std::vector<double>> radii_;
  std::vector<std::vector<Vec3>> at_;
};

}  // namespace

double Filling::largest_radius() const {
  double largest = sizes ? sizes->largest_radius() : 0;
  for (const auto& particle : particles) largest = std::max(largest, particle.radius);
  return largest;
}

double Filling::smallest_radius() const {
  double smallest = sizes ? sizes->smallest_radius() : particles.empty() ? 0 : particles.front().radius;
  for (const auto& particle : particles) smallest = std::min(smallest, particle.radius);
  return smallest;
}

std::vector<double> radii_of(const Filling& filling, std::size_t index, const FillSettings& settings) {
  std::vector<double> radii;
  if (filling.placing == Placing::given) {
    for (const auto& particle : filling.particles) radii.push_back(particle.radius);
    return radii;
  }
  auto random = stream(filling, index, diameters, settings);
  if (filling.count) {
    radii = filling.sizes->draw(*filling.count, random);
    if (filling.solid_fraction) {
      const double solid = solid_volume(radii, settings.dimension) / filling.region->volume();
      const double scale = std::pow(*filling.solid_fraction / solid, 1.0 / settings.dimension);
      for (auto& radius : radii) radius *= scale;
    }
    return radii;
  }
  if (filling.mass || filling.solid_fraction) {
    radii = filling.sizes->draw_volume(filling.mass ? *filling.mass / filling.density : *filling.solid_fraction * filling.region->volume(),
                                       random);
    if (radii.empty())
      throw io::UserError(filling.where,
                          fmt::format("{} asks for less than half of its smallest {}. Raise the amount or make them smaller.", filling.name,
                                      particle_word(settings.dimension)));
    return radii;
  }
  const auto vacant = [&](const Vec3& at, double radius) { return !settings.vacant || settings.vacant(at, radius * touching); };
  const auto sites = lattice_sites(*filling.region, filling.lattice, filling.largest_radius(), settings.gravity, vacant, 0);
  if (sites.empty())
    throw io::UserError(filling.where, fmt::format("no site of the lattice of {} is free in {}. Enlarge the region.", filling.name,
                                                   filling.region->text()));
  return filling.sizes->draw(sites.size(), random);
}

std::vector<NewParticle> fill(std::span<const Filling> fillings, const FillSettings& settings) { return Filler(fillings, settings).fill(); }

}  // namespace acopla::dem
