// Random numbers whose whole state is one integer, the same on every machine (the standard's distributions are not).
#pragma once

#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

namespace acopla::dem {

/// SplitMix64 (Steele, Lea & Flood 2014). Save state() and give it to restore(), or to the constructor, to go on where it was.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  /// Independent streams of one seed; stream 0 is Random(seed).
  static Random stream(std::uint64_t seed, std::uint64_t index) { return Random(seed ^ mixed(index)); }

  std::uint64_t state() const { return state_; }
  void restore(std::uint64_t state) { state_ = state; }

  std::uint64_t bits() { return mixed(state_ += 0x9e3779b97f4a7c15ULL); }
  /// In [0, 1).
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  /// Standard normal deviate (Box & Muller 1958). The sine's twin is dropped, so that nothing but the integer is state.
  double normal() {
    const double radius = std::sqrt(-2 * std::log(1 - uniform()));
    return radius * std::cos(2 * M_PI * uniform());
  }
  /// In 0 … n − 1, without bias; n > 0.
  std::uint64_t below(std::uint64_t n) {
    const std::uint64_t surplus = (0 - n) % n;  // 2⁶⁴ mod n of the integers would come once too often
    std::uint64_t drawn = bits();
    while (drawn < surplus) drawn = bits();
    return drawn % n;
  }
  /// Puts the values in random order (Fisher & Yates).
  template <class Value>
  void shuffle(std::vector<Value>& values) {
    for (std::size_t left = values.size(); left > 1; --left) std::swap(values[left - 1], values[below(left)]);
  }
  /// 0 … n − 1 in random order.
  std::vector<std::uint32_t> permutation(std::uint32_t n) {
    std::vector<std::uint32_t> order(n);
    for (std::uint32_t k = 0; k < n; ++k) order[k] = k;
    shuffle(order);
    return order;
  }

 private:
  static std::uint64_t mixed(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
  }
  std::uint64_t state_;
};

}  // namespace acopla::dem
