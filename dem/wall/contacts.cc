#include "dem/wall/contacts.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <tuple>
#include <utility>

namespace acopla::dem {
namespace {

constexpr auto nothing = static_cast<std::size_t>(-1);
constexpr std::uint16_t no_group = static_cast<std::uint16_t>(-1);

// A contact's numbers in packs.
double& number(std::vector<HistoryLane>& history, std::size_t numbers, std::size_t contact, std::size_t n) {
  return history[contact / lanes * numbers + n].value[contact % lanes];
}
double number(const std::vector<HistoryLane>& history, std::size_t numbers, std::size_t contact, std::size_t n) {
  return history[contact / lanes * numbers + n].value[contact % lanes];
}

[[noreturn]] void stop_at_wall(const WallSet& walls, const Particles& particles, std::uint32_t i, std::uint32_t element, double time) {
  const Vec3 x = particles.position[i].vector();
  throw std::runtime_error(fmt::format(
      "particle {} is pushed through wall {} at t = {:.6g} s: its centre at ({:.4g}, {:.4g}, {:.4g}) m has reached the surface. The "
      "contact is too soft for this load: raise the particles' stiffness or lower the speed.",
      particles.id[i], walls.walls()[walls.wall_of(element)].name, time, x[0], x[1], x[2]));
}

Record record_of(const Vec3& vector) { return {vector[0], vector[1], vector[2], 0}; }

// A centre this near to a surface, over the radius, has gone through it.
constexpr double least_distance = 0.05;

}  // namespace

void SavedWallHistories::clear() {
  contacts.clear();
  numbers.clear();
}

void SavedWallHistories::append(const SavedWallHistories& other) {
  const auto first = static_cast<std::uint32_t>(numbers.size());
  for (auto contact : other.contacts) {
    contact.first += first;
    contacts.push_back(contact);
  }
  numbers.insert(numbers.end(), other.numbers.begin(), other.numbers.end());
}

void SavedWallHistories::sort() {
  std::sort(contacts.begin(), contacts.end(), [](const Contact& a, const Contact& b) { return std::pair(a.id, a.element) < std::pair(b.id, b.element); });
}

WallContactList::Group& WallContactList::group_of(const KernelTable& kernels, const WallSet& walls, std::uint8_t particle_material,
                                                  std::uint8_t wall_material) {
  auto& place = place_[particle_material * materials_ + wall_material];
  if (place == no_group) {
    place = static_cast<std::uint16_t>(groups_.size());
    auto& group = groups_.emplace_back();
    group.particle_material = particle_material;
    group.wall_material = wall_material;
    const auto& kernel = kernels.of(particle_material, wall_material);
    group.numbers = kernel.history_size();
    group.turns = kernel.rotates() && walls.turn_at_all(wall_material);
  }
  return groups_[place];
}

// Whether the rules of touching.h are sure to give, wherever the centre moves by `travel`, one contact with each of some flat elements
// that never share a crease, and none with the others. The flat ones are left in flats_.
bool WallContactList::find_lone(const WallSet& walls, const Record& position, double travel, std::span<const std::uint32_t> elements) {
  const Vec3 centre = position.vector();
  flats_.clear();
  for (const auto element : elements)
    if (walls.is_plane(element) || walls.holds_foot(element, centre, travel)) flats_.push_back(element);
  for (std::size_t a = 0; a < flats_.size(); ++a)
    for (std::size_t b = a + 1; b < flats_.size(); ++b) {
      const auto wall_a = walls.wall_of(flats_[a]), wall_b = walls.wall_of(flats_[b]);
      if (wall_a != wall_b && (walls.turns(wall_a) || walls.turns(wall_b))) return false;
      const auto normal = [&](std::uint32_t element) {
        const Record flat = walls.to_world(walls.wall_of(element), walls.flat(element));
        const bool behind = flat.vector().dot(centre) < flat.w && !walls.is_plane(element);
        return behind ? Vec3(-flat.vector()) : flat.vector();
      };
      // At a right angle the crease is out of reach of every sphere that is not half through the walls.
      if (normal(flats_[a]).dot(normal(flats_[b])) > 1e-9) return false;
    }
  for (const auto element : elements) {
    if (std::find(flats_.begin(), flats_.end(), element) != flats_.end()) continue;
    const bool yields = std::any_of(flats_.begin(), flats_.end(), [&](std::uint32_t flat) {
      return walls.is_facet(flat) && walls.yields_to(element, flat, centre, travel);
    });
    if (!yields) return false;
  }
  return true;
}

void WallContactList::sort_by_wall(const WallSet& walls, Group& group) {
  std::vector<std::uint32_t> order(group.lone.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t k, std::uint32_t l) {
    const auto &a = group.lone[k], &b = group.lone[l];
    return std::tuple(walls.wall_of(a.element), a.particle, a.element) < std::tuple(walls.wall_of(b.element), b.particle, b.element);
  });
  const auto lone = group.lone;
  const auto flats = group.flats;
  for (std::size_t k = 0; k < order.size(); ++k) {
    group.lone[k] = lone[order[k]];
    group.flats[k] = flats[order[k]];
  }
  group.runs.clear();
  for (std::uint32_t k = 0; k < group.lone.size(); ++k) {
    const auto wall = walls.wall_of(group.lone[k].element);
    if (group.runs.empty() || group.runs.back().wall != wall) group.runs.push_back({wall, 0});
    group.runs.back().end = k + 1;
  }
}

void WallContactList::find(const KernelTable& kernels, const WallSet& walls, const Particles& particles, std::uint32_t first, std::uint32_t last,
                           double skin) {
  materials_ = kernels.materials;
  place_.assign(materials_ * materials_, no_group);
  groups_.clear();
  near_.clear();
  elements_.clear();
  start_.assign(1, 0);
  resultants_.assign(walls.walls().size(), {});
  if (walls.empty()) return;
  for (auto i = first; i < last; ++i) {
    const auto& position = particles.position[i];
    found_elements_.clear();
    walls.find_near(position.vector(), position.w + 0.5 * skin, found_elements_);
    if (found_elements_.empty()) continue;
    const auto group = [&](std::uint32_t element) -> Group& {
      const auto wall = walls.wall_of(element);
      auto& chosen = group_of(kernels, walls, particles.material[i], walls.walls()[wall].material);
      chosen.moves = chosen.moves || walls.walls()[wall].motion.moves();
      return chosen;
    };
    while (!found_elements_.empty() && walls.is_ball(found_elements_.back())) {  // they come last
      auto& chosen = group(found_elements_.back());
      chosen.balls.push_back({i, found_elements_.back()});
      chosen.curved = true;
      found_elements_.pop_back();
    }
    if (found_elements_.empty()) continue;
    if (find_lone(walls, position, 0.5 * skin * (1 + 1e-9), found_elements_)) {
      for (const auto element : flats_) {
        auto flat = walls.flat(element);
        if (walls.is_facet(element)) {
          const Record now = walls.to_world(walls.wall_of(element), flat);
          if (now.vector().dot(position.vector()) < now.w) flat = {-flat.x, -flat.y, -flat.z, -flat.w};
        }
        auto& chosen = group(element);
        chosen.lone.push_back({i, element});
        chosen.flats.push_back(flat);
      }
      continue;
    }
    for (const auto element : found_elements_) ++group(element).ruled;
    near_.push_back(i);
    elements_.insert(elements_.end(), found_elements_.begin(), found_elements_.end());
    start_.push_back(static_cast<std::uint32_t>(elements_.size()));
  }
  for (auto& group : groups_) {
    group.turns = group.turns && group.moves;
    // Wall by wall, so that loads are summed in registers.
    sort_by_wall(walls, group);
    std::sort(group.balls.begin(), group.balls.end(),
              [](const Near& a, const Near& b) { return std::pair(a.particle, a.element) < std::pair(b.particle, b.element); });
    const auto size = (group.capacity() + lanes) / lanes * lanes;  // one spare at least: contacts are written before it is known that they are any
    auto& contacts = group.contacts;
    contacts.particle.resize(size);
    contacts.normal.resize(size);
    contacts.velocity.assign(size, {0, 0, 0, 1});
    if (group.turns) contacts.wall_spin.resize(size);
    if (group.curved) contacts.curvature.assign(size, 0);
    contacts.history.assign(size / lanes * group.numbers, {});
    group.history_before = contacts.history;
    group.key.resize(size);
    group.key_before.resize(size);
    group.detail.resize(group.ruled);
    group.detail_before.resize(group.ruled);
  }
}

void WallContactList::collect(const Particles& particles, SavedWallHistories& saved) const {
  for (const auto& group : groups_) {
    if (group.numbers == 0) continue;
    for (std::size_t c = 0; c < group.contacts.size; ++c) {
      const auto i = group.contacts.particle[c];
      const auto& normal = group.contacts.normal[c];
      const double arm = particles.position[i].w - normal.w;
      saved.contacts.push_back({particles.id[i], element_of(group, c), particles.position[i].vector() - arm * normal.vector(), normal.vector(),
                                static_cast<std::uint32_t>(saved.numbers.size()), static_cast<std::uint32_t>(group.numbers)});
      for (std::size_t n = 0; n < group.numbers; ++n) saved.numbers.push_back(number(group.contacts.history, group.numbers, c, n));
    }
  }
}

void WallContactList::restore(const WallSet& walls, const Particles& particles, const SavedWallHistories& saved) {
  if (saved.contacts.empty()) return;
  std::vector<bool> used(saved.contacts.size(), false);
  const auto of_particle = [&](std::uint32_t id) {
    const auto first = std::lower_bound(saved.contacts.begin(), saved.contacts.end(), id, [](const auto& c, std::uint32_t value) { return c.id < value; });
    auto last = first;
    while (last != saved.contacts.end() && last->id == id) ++last;
    return std::pair(static_cast<std::size_t>(first - saved.contacts.begin()), static_cast<std::size_t>(last - saved.contacts.begin()));
  };
  const auto same = [&](std::uint32_t particle, std::uint32_t element) {
    const auto [first, last] = of_particle(particles.id[particle]);
    for (auto s = first; s < last; ++s)
      if (saved.contacts[s].element == element && !used[s]) {
        used[s] = true;
        return s;
      }
    return nothing;
  };
  // Where a particle has just left an element for the inside of another, see inherit().
  const auto left_behind = [&](const Near& lone, const Record& body_flat) {
    const auto [first, last] = of_particle(particles.id[lone.particle]);
    const auto wall = walls.wall_of(lone.element);
    const Record flat = walls.to_world(wall, body_flat);
    const auto& position = particles.position[lone.particle];
    const Vec3 foot = position.vector() - (flat.vector().dot(position.vector()) - flat.w) * flat.vector();
    for (auto s = first; s < last; ++s)
      if (!used[s] && walls.wall_of(saved.contacts[s].element) == wall && saved.contacts[s].normal.dot(flat.vector()) > 0.5 &&
          (saved.contacts[s].point - foot).norm() < position.w) {
        used[s] = true;
        return s;
      }
    return nothing;
  };
  for (auto& group : groups_) {
    if (group.numbers == 0) continue;
    std::vector<std::size_t> origin(group.lone.size());
    for (std::size_t k = 0; k < group.lone.size(); ++k) origin[k] = same(group.lone[k].particle, group.lone[k].element);
    for (std::size_t k = 0; k < group.lone.size(); ++k)
      if (origin[k] == nothing) origin[k] = left_behind(group.lone[k], group.flats[k]);
    std::size_t c = 0;
    const auto add = [&](std::size_t key, std::uint32_t particle, std::size_t s) {
      if (s == nothing || saved.contacts[s].size != group.numbers) return false;
      group.key[c] = static_cast<std::uint32_t>(key);
      group.contacts.particle[c] = particle;
      for (std::size_t n = 0; n < group.numbers; ++n) number(group.contacts.history, group.numbers, c, n) = saved.numbers[saved.contacts[s].first + n];
      ++c;
      return true;
    };
    for (std::size_t k = 0; k < group.lone.size(); ++k) add(k, group.lone[k].particle, origin[k]);
    for (std::size_t k = 0; k < group.balls.size(); ++k)
      add(group.lone.size() + k, group.balls[k].particle, same(group.balls[k].particle, group.balls[k].element));
    group.first_ruled = c;
    for (std::uint32_t f = 0; f < near_.size(); ++f)
      if (particles.material[near_[f]] == group.particle_material)
        for (auto e = start_[f]; e < start_[f + 1]; ++e) {
          if (walls.walls()[walls.wall_of(elements_[e])].material != group.wall_material) continue;
          const auto s = same(near_[f], elements_[e]);
          if (add(group.first_ruled_key() + e, near_[f], s))
            group.detail[c - 1 - group.first_ruled] = {record_of(saved.contacts[s].point), record_of(saved.contacts[s].normal), {}, elements_[e], f};
        }
    group.contacts.size = c;
  }
}

void WallContactList::start_step(Group& group) {
  group.key.swap(group.key_before);
  group.detail.swap(group.detail_before);
  group.size_before = group.contacts.size;
  group.first_ruled_before = group.first_ruled;
  group.contacts.size = 0;
}

void WallContactList::update(const WallSet& walls, const Particles& particles, double time) {
  for (auto& group : groups_) {
    start_step(group);
    touch_lone(group, walls, particles, time);
    touch_balls(group, walls, particles, time);
    group.first_ruled = group.contacts.size;
  }
  if (!near_.empty()) touch_by_rules(walls, particles, time);
  for (auto& group : groups_) finish_step(group, walls, particles);
}

// Every candidate is written where the next contact belongs, and counted only if it is one: no branch to guess wrong.
void WallContactList::touch_lone(Group& group, const WallSet& walls, const Particles& particles, double time) {
  auto& contacts = group.contacts;
  const Record* const position = particles.position.data();
  std::size_t count = 0;
  bool through = false;
  const auto touch = [&](std::size_t k, const Record& flat) {
    const auto particle = group.lone[k].particle;
    const auto& x = position[particle];
    const double height = flat.x * x.x + flat.y * x.y + flat.z * x.z - flat.w, overlap = x.w - height;
    contacts.particle[count] = particle;
    contacts.normal[count] = {flat.x, flat.y, flat.z, overlap};
    group.key[count] = static_cast<std::uint32_t>(k);
    through |= !(height > least_distance * x.w);
    return overlap > 0;
  };
  std::size_t k = 0;
  for (const auto& [wall, end] : group.runs) {
    if (!group.moves && group.ruled == 0 && group.balls.empty()) {  // all velocities are zero and stay so
      for (; k < end; ++k) count += touch(k, group.flats[k]);
    } else if (!walls.moves(wall)) {
      for (; k < end; ++k) {
        contacts.velocity[count] = {0, 0, 0, 1};
        if (group.turns) contacts.wall_spin[count] = {};
        if (group.curved) contacts.curvature[count] = 0;
        count += touch(k, group.flats[k]);
      }
    } else if (!walls.turns(wall)) {
      const Vec3 shift = walls.shift(wall), v = walls.velocity(wall);
      const Record velocity{v[0], v[1], v[2], 1};
      for (; k < end; ++k) {
        Record flat = group.flats[k];
        flat.w += flat.x * shift[0] + flat.y * shift[1] + flat.z * shift[2];
        contacts.velocity[count] = velocity;
        if (group.turns) contacts.wall_spin[count] = {};
        if (group.curved) contacts.curvature[count] = 0;
        count += touch(k, flat);
      }
    } else {
      const Record spin = record_of(walls.spin_of(group.lone[k].element));
      for (; k < end; ++k) {
        const Record flat = walls.to_world(wall, group.flats[k]);
        const auto& x = position[group.lone[k].particle];
        const double height = flat.x * x.x + flat.y * x.y + flat.z * x.z - flat.w;
        const Vec3 velocity = walls.rigid_velocity(wall, x.vector() - height * flat.vector());
        contacts.velocity[count] = {velocity[0], velocity[1], velocity[2], 1};
        if (group.turns) contacts.wall_spin[count] = spin;
        if (group.curved) contacts.curvature[count] = 0;
        count += touch(k, flat);
      }
    }
  }
  contacts.size = count;
  if (through) stop_lone(group, walls, particles, time);
}

void WallContactList::stop_lone(const Group& group, const WallSet& walls, const Particles& particles, double time) {
  for (std::size_t k = 0; k < group.lone.size(); ++k) {
    const auto& lone = group.lone[k];
    const auto flat = walls.to_world(walls.wall_of(lone.element), group.flats[k]);
    const auto& x = particles.position[lone.particle];
    if (!(flat.x * x.x + flat.y * x.y + flat.z * x.z - flat.w > least_distance * x.w)) stop_at_wall(walls, particles, lone.particle, lone.element, time);
  }
}

void WallContactList::touch_balls(Group& group, const WallSet& walls, const Particles& particles, double time) {
  auto& contacts = group.contacts;
  for (std::size_t k = 0; k < group.balls.size(); ++k) {
    const auto [particle, element] = group.balls[k];
    const auto& position = particles.position[particle];
    NearestPoint nearest;
    if (!walls.touches(element, position.vector(), position.w, nearest)) continue;
    if (!(nearest.distance > least_distance * position.w)) stop_at_wall(walls, particles, particle, element, time);
    const auto c = contacts.size++;
    group.key[c] = static_cast<std::uint32_t>(group.lone.size() + k);
    contacts.particle[c] = particle;
    contacts.normal[c].set(nearest.normal);
    contacts.normal[c].w = position.w - nearest.distance;
    contacts.velocity[c].set(group.moves ? walls.velocity_at(nearest) : Vec3(Vec3::Zero()));
    contacts.velocity[c].w = 1;
    contacts.curvature[c] = walls.curvature(element);
    if (group.turns) contacts.wall_spin[c].set(walls.spin_of(element));
  }
}

void WallContactList::touch_by_rules(const WallSet& walls, const Particles& particles, double time) {
  for (std::uint32_t f = 0; f < near_.size(); ++f) {
    const auto i = near_[f];
    const Vec3 centre = particles.position[i].vector();
    const double radius = particles.position[i].w;
    found_.clear();
    NearestPoint nearest;
    for (auto e = start_[f]; e < start_[f + 1]; ++e)
      if (walls.touches(elements_[e], centre, radius, nearest)) found_.push_back(nearest);
    if (found_.empty()) continue;
    keep_contacts(walls, radius, found_);
    if (found_.size() > 1)
      std::sort(found_.begin(), found_.end(), [](const NearestPoint& a, const NearestPoint& b) { return a.element < b.element; });
    weights_.resize(found_.size());
    share_creases(radius, found_, weights_);
    for (std::size_t c = 0; c < found_.size(); ++c) {
      if (!(found_[c].distance > least_distance * radius)) stop_at_wall(walls, particles, i, found_[c].element, time);
      add_by_rules(walls, particles.material[i], i, f, found_[c], radius - found_[c].distance, weights_[c]);
    }
  }
}

void WallContactList::add_by_rules(const WallSet& walls, std::uint8_t particle_material, std::uint32_t particle, std::uint32_t near,
                                   const NearestPoint& contact, double overlap, double weight) {
  auto& group = groups_[place_[particle_material * materials_ + walls.walls()[walls.wall_of(contact.element)].material]];
  auto& contacts = group.contacts;
  const auto c = contacts.size++;
  const auto place = std::find(elements_.begin() + start_[near], elements_.begin() + start_[near + 1], contact.element) - elements_.begin();
  group.key[c] = group.first_ruled_key() + static_cast<std::uint32_t>(place);
  contacts.particle[c] = particle;
  contacts.normal[c].set(contact.normal);
  contacts.normal[c].w = overlap;
  contacts.velocity[c].set(group.moves ? walls.velocity_at(contact) : Vec3(Vec3::Zero()));
  contacts.velocity[c].w = weight;
  if (group.turns) contacts.wall_spin[c].set(walls.spin_of(contact.element));
  if (group.curved) contacts.curvature[c] = 0;
  group.detail[c - group.first_ruled] = {record_of(contact.point), record_of(contact.normal), contact.weights, contact.element, near};
}

// Spare lanes repeat the last contact. Histories stay where they are while the contacts are the same.
void WallContactList::finish_step(Group& group, const WallSet& walls, const Particles& particles) {
  auto& contacts = group.contacts;
  const auto size = contacts.size;
  for (auto spare = size; size > 0 && spare % lanes != 0; ++spare) {
    contacts.particle[spare] = contacts.particle[size - 1];
    contacts.normal[spare] = contacts.normal[size - 1];
    contacts.velocity[spare] = contacts.velocity[size - 1];
    if (group.turns) contacts.wall_spin[spare] = contacts.wall_spin[size - 1];
    if (group.curved) contacts.curvature[spare] = contacts.curvature[size - 1];
  }
  const auto keys = group.key.begin(), before = group.key_before.begin();
  const bool same = size == group.size_before && std::equal(keys, keys + static_cast<std::ptrdiff_t>(size), before);
  if (!same && group.numbers > 0) move_histories(group, walls, particles);
}

void WallContactList::move_histories(Group& group, const WallSet& walls, const Particles& particles) {
  const auto size = group.contacts.size, size_before = group.size_before, numbers = group.numbers;
  group.history_before.swap(group.contacts.history);
  auto& history = group.contacts.history;
  std::fill(history.begin(), history.begin() + static_cast<std::ptrdiff_t>((size + lanes - 1) / lanes * numbers), HistoryLane{});
  origin_.assign(size, nothing);
  for (std::size_t c = 0, b = 0; c < size; ++c) {
    while (b < size_before && group.key_before[b] < group.key[c]) ++b;
    if (b == size_before || group.key_before[b] != group.key[c]) continue;
    origin_[c] = b;
    for (std::size_t n = 0; n < numbers; ++n) number(history, numbers, c, n) = number(group.history_before, numbers, b, n);
  }
  // Particle by particle: contacts by the rules that are new may go on with what the particle has left.
  std::size_t before = group.first_ruled_before;
  for (auto c = group.first_ruled; c < size;) {
    const auto near = group.detail[c - group.first_ruled].near;
    auto last = c;
    bool orphans = false;
    for (; last < size && group.detail[last - group.first_ruled].near == near; ++last) orphans = orphans || origin_[last] == nothing;
    while (before < size_before && group.detail_before[before - group.first_ruled_before].near < near) ++before;
    auto last_before = before;
    while (last_before < size_before && group.detail_before[last_before - group.first_ruled_before].near == near) ++last_before;
    if (orphans && last_before > before) inherit(group, walls, particles.position[near_[near]].w, c, last, before, last_before);
    c = last;
    before = last_before;
  }
}

// A contact of a particle that has no history of its own gets that of a contact of the same wall that the particle has left (it moved
// across an edge), else a share of a contact it shares a crease with.
void WallContactList::inherit(Group& group, const WallSet& walls, double radius, std::size_t first, std::size_t last, std::size_t first_before,
                              std::size_t last_before) {
  const auto numbers = group.numbers;
  const auto detail = [&](std::size_t c) -> const Detail& { return group.detail[c - group.first_ruled]; };
  const auto detail_before = [&](std::size_t b) -> const Detail& { return group.detail_before[b - group.first_ruled_before]; };
  used_.assign(last_before - first_before, false);
  for (auto c = first; c < last; ++c)
    if (origin_[c] != nothing) used_[origin_[c] - first_before] = true;
  auto& history = group.contacts.history;
  for (auto c = first; c < last; ++c) {
    if (origin_[c] != nothing) continue;
    double nearest = radius * radius;
    for (auto b = first_before; b < last_before; ++b) {
      const auto &mine = detail(c), &left = detail_before(b);
      const double square = (left.point.vector() - mine.point.vector()).squaredNorm();
      if (!used_[b - first_before] && square < nearest && left.normal.vector().dot(mine.normal.vector()) > 0.5 &&
          walls.wall_of(left.element) == walls.wall_of(mine.element)) {
        nearest = square;
        origin_[c] = b;
      }
    }
    if (origin_[c] == nothing) continue;
    used_[origin_[c] - first_before] = true;
    for (std::size_t n = 0; n < numbers; ++n) number(history, numbers, c, n) = number(group.history_before, numbers, origin_[c], n);
  }
  const auto nearest_point = [&](std::size_t c) {
    NearestPoint contact;
    contact.normal = detail(c).normal.vector();
    contact.distance = radius - group.contacts.normal[c].w;
    return contact;
  };
  for (auto c = first; c < last; ++c) {
    if (origin_[c] != nothing) continue;
    for (auto other = first; other < last; ++other) {
      if (origin_[other] == nothing) continue;
      const double share = crease_share(radius, nearest_point(c), nearest_point(other));
      if (share <= 0) continue;
      for (std::size_t n = 0; n < numbers; ++n) number(history, numbers, c, n) = share * number(history, numbers, other, n);
      break;
    }
  }
}

std::uint32_t WallContactList::element_of(const Group& group, std::size_t contact) const {
  const auto key = group.key[contact];
  if (key < group.lone.size()) return group.lone[key].element;
  if (key < group.first_ruled_key()) return group.balls[key - group.lone.size()].element;
  return elements_[key - group.first_ruled_key()];
}

void WallContactList::evaluate(const KernelTable& kernels, const WallSet& walls, Particles& particles, double step, WallForces& forces,
                               ContactEnergy<double>* energy) {
  for (auto& resultant : resultants_) resultant = {};
  for (auto& group : groups_) {
    if (group.contacts.size == 0) continue;
    const auto& kernel = kernels.of(group.particle_material, group.wall_material);
    kernel.walls(group.contacts, particles, step, energy);
    load(group, kernel.rolls(), walls, particles, forces);
  }
  for (std::size_t w = 0; w < resultants_.size(); ++w) forces.walls[w] += resultants_[w];
}

void WallContactList::load(const Group& group, bool rolls, const WallSet& walls, const Particles& particles, WallForces& forces) {
  const auto& contacts = group.contacts;
  WallResultant sum;
  std::uint32_t wall = WallSet::none;
  for (std::size_t c = 0; c < contacts.size; ++c) {
    const auto element = element_of(group, c);
    if (const auto of = walls.wall_of(element); of != wall) {
      if (wall != WallSet::none) resultants_[wall] += sum;
      sum = {};
      wall = of;
    }
    const Vec3 force = contacts.force[c].vector(), normal = contacts.normal[c].vector();
    const auto& position = particles.position[contacts.particle[c]];
    const Vec3 point = position.vector() - (position.w - contacts.normal[c].w) * normal;
    Vec3 couple = Vec3::Zero();
    if (rolls) couple = contacts.torque[c].vector();
    sum.force -= force;
    sum.torque -= (point - walls.reference(wall)).cross(force) + couple;
    if (group.moves) {
      sum.power += force.dot(contacts.velocity[c].vector());
      if (rolls && group.turns) sum.power += couple.dot(contacts.wall_spin[c].vector());
    }
    if (walls.sends(wall)) spread(group, c, element, walls, point, force, couple, forces);
  }
  if (wall != WallSet::none) resultants_[wall] += sum;
}

// Of a facet the force acts at a point on it, so that barycentric weights carry force and moment. Of a ball it acts beside the facet.
void WallContactList::spread(const Group& group, std::size_t contact, std::uint32_t element, const WallSet& walls, const Vec3& point,
                             const Vec3& force, const Vec3& couple, WallForces& forces) {
  const auto facet = walls.carrier(element);
  if (facet == WallSet::none) return;
  const auto wall = walls.wall_of(element);
  std::array<double, 3> weights;
  Vec3 rest = couple;
  if (walls.is_ball(element)) {
    weights = walls.ball_weights(element);
    rest += (point - walls.ball(element).centre).cross(force);
  } else if (contact < group.first_ruled) {
    weights = walls.foot_weights(facet, walls.to_body(wall, point));
  } else {
    weights = group.detail[contact - group.first_ruled].weights;
  }
  const bool turns = walls.turns(wall);
  const Vec3 own = turns ? Vec3(walls.rotation(wall).transpose() * force) : force;
  for (std::size_t k = 0; k < walls.vertices_of(facet); ++k) forces.vertex[walls.sent_vertex(wall, walls.facet(facet)[k])] -= weights[k] * own;
  forces.couple[walls.sent_facet(wall, facet)] -= turns ? Vec3(walls.rotation(wall).transpose() * rest) : rest;
}

void WallContactList::add_stiffness(const KernelTable& kernels, const WallSet& walls, const Particles& particles, WallForces& stiffness,
                                    WallForces& dashpot, WallForces& mass) const {
  for (const auto& group : groups_) {
    const auto& contacts = group.contacts;
    if (contacts.size == 0) continue;
    const auto& kernel = kernels.of(group.particle_material, group.wall_material);
    for (std::size_t c = 0; c < contacts.size; ++c) {
      const auto element = element_of(group, c);
      const double overlap = contacts.normal[c].w;
      if (!walls.sends(walls.wall_of(element)) || overlap <= 0) continue;
      const auto i = contacts.particle[c];
      const double r = particles.radius_of(i), curvature = contacts.curvature.empty() ? 0 : contacts.curvature[c];
      const auto rates = kernel.stiffness(overlap, r / (1 + r * curvature), particles.mass_of(i), particles.inertia_of(i));
      const Vec3 point = particles.position[i].vector() - (r - overlap) * contacts.normal[c].vector();
      spread(group, c, element, walls, point, Vec3::Constant(-std::max(rates.normal, rates.shear)), Vec3::Zero(), stiffness);
      spread(group, c, element, walls, point, Vec3::Constant(-std::max(rates.normal_dashpot, rates.shear_dashpot)), Vec3::Zero(), dashpot);
      spread(group, c, element, walls, point, Vec3::Constant(-particles.mass_of(i)), Vec3::Zero(), mass);
    }
  }
}

std::size_t WallContactList::contact_count() const {
  std::size_t count = 0;
  for (const auto& group : groups_) count += group.contacts.size;
  return count;
}

std::size_t WallContactList::candidate_count() const {
  std::size_t count = 0;
  for (const auto& group : groups_) count += group.capacity();
  return count;
}

}  // namespace acopla::dem
