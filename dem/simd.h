// Packs of doubles. The only file that knows how: GCC's vector types, which become AVX-512, AVX or pairs of SSE2 registers, as the
// build has them. (std::experimental::simd has no gather and no permute.)
//
// The pack is as wide as the machine's registers. Eight lanes pay beyond the arithmetic: a contact law is one long chain of roots and
// quotients, and what a processor can look ahead holds little more than one pack of it.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "dem/particles.h"

#ifdef __SSE2__
#include <immintrin.h>
#endif

namespace acopla::dem {

/// Contacts of a pack.
#if defined(__AVX512F__)
inline constexpr std::size_t lanes = 8;
#elif defined(__AVX__)
inline constexpr std::size_t lanes = 4;
#else  // GCC takes the comparisons and shuffles of a pack wider than a register apart, number by number
inline constexpr std::size_t lanes = 2;
#endif

struct MaskPack {
  using Vector = long long __attribute__((vector_size(8 * lanes)));
  Vector v;
  friend MaskPack operator&(const MaskPack& a, const MaskPack& b) { return {a.v & b.v}; }
};

struct DoublePack {
  using Vector = double __attribute__((vector_size(8 * lanes)));
  Vector v;
  DoublePack() = default;
  // NOLINTNEXTLINE: a scalar is meant to mix with vectors
#if defined(__AVX512F__)
  DoublePack(double all) : v{all, all, all, all, all, all, all, all} {}
#elif defined(__AVX__)
  DoublePack(double all) : v{all, all, all, all} {}
#else
  DoublePack(double all) : v{all, all} {}
#endif
  explicit DoublePack(const Vector& vector) : v(vector) {}
  double operator[](std::size_t lane) const { return v[lane]; }

  friend DoublePack operator+(const DoublePack& a, const DoublePack& b) { return DoublePack(a.v + b.v); }
  friend DoublePack operator-(const DoublePack& a, const DoublePack& b) { return DoublePack(a.v - b.v); }
  friend DoublePack operator*(const DoublePack& a, const DoublePack& b) { return DoublePack(a.v * b.v); }
  friend DoublePack operator/(const DoublePack& a, const DoublePack& b) { return DoublePack(a.v / b.v); }
  friend DoublePack operator-(const DoublePack& a) { return DoublePack(-a.v); }
  friend MaskPack operator<(const DoublePack& a, const DoublePack& b) { return {a.v < b.v}; }
  friend MaskPack operator==(const DoublePack& a, const DoublePack& b) { return {a.v == b.v}; }
  friend MaskPack operator>(const DoublePack& a, const DoublePack& b) { return {a.v > b.v}; }
};

/// Lane by lane: where the mask holds `yes`, else `no`. Both are computed.
inline DoublePack select(const MaskPack& mask, const DoublePack& yes, const DoublePack& no) { return DoublePack(mask.v ? yes.v : no.v); }
inline double select(bool mask, double yes, double no) { return mask ? yes : no; }

inline DoublePack max(const DoublePack& a, const DoublePack& b) { return DoublePack(a.v > b.v ? a.v : b.v); }
inline DoublePack min(const DoublePack& a, const DoublePack& b) { return DoublePack(a.v < b.v ? a.v : b.v); }

inline DoublePack sqrt(const DoublePack& a) {
#if defined(__AVX512F__)
  return DoublePack(static_cast<DoublePack::Vector>(_mm512_sqrt_pd(static_cast<__m512d>(a.v))));
#elif defined(__AVX__)
  return DoublePack(static_cast<DoublePack::Vector>(_mm256_sqrt_pd(static_cast<__m256d>(a.v))));
#elif defined(__SSE2__)
  return DoublePack(static_cast<DoublePack::Vector>(_mm_sqrt_pd(static_cast<__m128d>(a.v))));
#else
  DoublePack root;
  for (std::size_t lane = 0; lane < lanes; ++lane) root.v[lane] = std::sqrt(a.v[lane]);
  return root;
#endif
}

inline double sum(const DoublePack& a) {
  double total = 0;
  for (std::size_t lane = 0; lane < lanes; ++lane) total += a.v[lane];
  return total;
}

/// A bit a lane.
inline unsigned bits(const MaskPack& mask) {
#if defined(__AVX512F__)
  return _mm512_cmplt_epi64_mask(static_cast<__m512i>(mask.v), _mm512_setzero_si512());
#elif defined(__AVX__)
  return static_cast<unsigned>(_mm256_movemask_pd(_mm256_castsi256_pd(static_cast<__m256i>(mask.v))));
#else
  unsigned all = 0;
  for (std::size_t lane = 0; lane < lanes; ++lane) all |= static_cast<unsigned>(mask.v[lane] != 0) << lane;
  return all;
#endif
}

/// 1 in the first `count` lanes, 0 in the others.
inline DoublePack first_lanes(std::size_t count) {
  DoublePack ones;
  for (std::size_t lane = 0; lane < lanes; ++lane) ones.v[lane] = lane < count ? 1.0 : 0.0;
  return ones;
}

/// Lanes from memory; `at` need not be aligned.
inline DoublePack load(const double* at) {
  DoublePack pack;
  std::memcpy(&pack.v, at, sizeof pack.v);
  return pack;
}
inline void store(double* at, const DoublePack& value) {
  std::memcpy(at, &value.v, sizeof value.v);
}

/// A record is four aligned doubles, so it may be read and written as one vector.
using RecordVector = double __attribute__((vector_size(32), may_alias));
inline const RecordVector& as_vector(const Record& record) { return reinterpret_cast<const RecordVector&>(record); }
inline RecordVector& as_vector(Record& record) { return reinterpret_cast<RecordVector&>(record); }

/// A record a lane, by components: what a pack of contacts needs. Such aggregates, Vector too, are best not declared `const` where they are
/// filled by a call: GCC 12 would not take them apart, and stores them for nobody to read.
struct RecordPack {
  DoublePack x, y, z, w;
};

namespace simd {

using Vector = DoublePack::Vector;

#ifdef __AVX__
/// Four rows, one a record (of eight lanes: a record in either half), from and to four components. Its own inverse.
inline RecordPack transposed(const Vector& a, const Vector& b, const Vector& c, const Vector& d) {
#ifdef __AVX512F__
  const auto ab_even = __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14), ab_odd = __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
  const auto cd_even = __builtin_shufflevector(c, d, 0, 8, 2, 10, 4, 12, 6, 14), cd_odd = __builtin_shufflevector(c, d, 1, 9, 3, 11, 5, 13, 7, 15);
  return {DoublePack(__builtin_shufflevector(ab_even, cd_even, 0, 1, 8, 9, 4, 5, 12, 13)),
          DoublePack(__builtin_shufflevector(ab_odd, cd_odd, 0, 1, 8, 9, 4, 5, 12, 13)),
          DoublePack(__builtin_shufflevector(ab_even, cd_even, 2, 3, 10, 11, 6, 7, 14, 15)),
          DoublePack(__builtin_shufflevector(ab_odd, cd_odd, 2, 3, 10, 11, 6, 7, 14, 15))};
#else
  const auto ab_even = __builtin_shufflevector(a, b, 0, 4, 2, 6), ab_odd = __builtin_shufflevector(a, b, 1, 5, 3, 7);
  const auto cd_even = __builtin_shufflevector(c, d, 0, 4, 2, 6), cd_odd = __builtin_shufflevector(c, d, 1, 5, 3, 7);
  return {DoublePack(__builtin_shufflevector(ab_even, cd_even, 0, 1, 4, 5)), DoublePack(__builtin_shufflevector(ab_odd, cd_odd, 0, 1, 4, 5)),
          DoublePack(__builtin_shufflevector(ab_even, cd_even, 2, 3, 6, 7)), DoublePack(__builtin_shufflevector(ab_odd, cd_odd, 2, 3, 6, 7))};
#endif
}
#endif

#ifdef __AVX512F__
// By intrinsics: GCC 12 takes the general shuffle of two halves through memory.
inline Vector joined(const Record& low, const Record& high) {
  return static_cast<Vector>(_mm512_insertf64x4(_mm512_castpd256_pd512(_mm256_load_pd(&low.x)), _mm256_load_pd(&high.x), 1));
}
inline RecordVector low_half(const Vector& v) { return static_cast<RecordVector>(_mm512_castpd512_pd256(static_cast<__m512d>(v))); }
inline RecordVector high_half(const Vector& v) { return static_cast<RecordVector>(_mm512_extractf64x4_pd(static_cast<__m512d>(v), 1)); }
#endif

#ifndef __AVX__
/// A record in two registers.
using HalfRecord = double __attribute__((vector_size(16), may_alias));
struct Halves {
  HalfRecord low, high;
};
inline const HalfRecord* halves(const Record& record) { return reinterpret_cast<const HalfRecord*>(&record); }
inline HalfRecord* halves(Record& record) { return reinterpret_cast<HalfRecord*>(&record); }
inline void add(Record& record, const Halves& row) {
  halves(record)[0] += row.low;
  halves(record)[1] += row.high;
}
inline void put(Record& record, const Halves& row) {
  halves(record)[0] = row.low;
  halves(record)[1] = row.high;
}
inline Halves operator-(const Halves& row) { return {-row.low, -row.high}; }
inline Halves operator+(const Halves& a, const Halves& b) { return {a.low + b.low, a.high + b.high}; }
inline Halves operator-(const Halves& a, const Halves& b) { return {a.low - b.low, a.high - b.high}; }
inline Halves operator*(const Halves& row, double factor) { return {row.low * factor, row.high * factor}; }
#endif
inline void add(Record& record, const RecordVector& row) { as_vector(record) += row; }
inline void put(Record& record, const RecordVector& row) { as_vector(record) = row; }

/// A pack as one record a lane.
class Rows {
 public:
#ifdef __AVX__
  explicit Rows(const RecordPack& values) : rows_(transposed(values.x.v, values.y.v, values.z.v, values.w.v)) {}
#else
  explicit Rows(const RecordPack& p)
      : row_{{__builtin_shufflevector(p.x.v, p.y.v, 0, 2), __builtin_shufflevector(p.z.v, p.w.v, 0, 2)},
             {__builtin_shufflevector(p.x.v, p.y.v, 1, 3), __builtin_shufflevector(p.z.v, p.w.v, 1, 3)}} {}
#endif
  /// @param use  called with the record of that lane, as add() and put() take it
  template <class Use>
  [[gnu::always_inline]] void of(std::size_t lane, Use&& use) const {
#ifdef __AVX__
    const Vector& row = (lane % 4 == 0 ? rows_.x : lane % 4 == 1 ? rows_.y : lane % 4 == 2 ? rows_.z : rows_.w).v;
#ifdef __AVX512F__
    use(lane < 4 ? low_half(row) : high_half(row));
#else
    use(row);
#endif
#else
    use(row_[lane]);
#endif
  }

 private:
#ifdef __AVX__
  RecordPack rows_;
#else
  Halves row_[2];
#endif
};

/// Calls action(lane) for the first `count` lanes; whole packs without a loop, so that all of it stays in registers.
template <class Action>
[[gnu::always_inline]] inline void for_each_lane(std::size_t count, Action&& action) {
  if (count == lanes) [[likely]] {
    action(0), action(1);
    if constexpr (lanes >= 4) action(2), action(3);
    if constexpr (lanes == 8) action(4), action(5), action(6), action(7);
    return;
  }
  for (std::size_t lane = 0; lane < count; ++lane) action(lane);
}

}  // namespace simd

inline RecordPack gathered(const Record* records, const std::uint32_t* which) {
#if defined(__AVX512F__)
  using simd::joined;
  return simd::transposed(joined(records[which[0]], records[which[4]]), joined(records[which[1]], records[which[5]]),
                          joined(records[which[2]], records[which[6]]), joined(records[which[3]], records[which[7]]));
#elif defined(__AVX__)
  return simd::transposed(as_vector(records[which[0]]), as_vector(records[which[1]]), as_vector(records[which[2]]), as_vector(records[which[3]]));
#else
  const auto *a = simd::halves(records[which[0]]), *b = simd::halves(records[which[1]]);
  return {DoublePack(__builtin_shufflevector(a[0], b[0], 0, 2)), DoublePack(__builtin_shufflevector(a[0], b[0], 1, 3)),
          DoublePack(__builtin_shufflevector(a[1], b[1], 0, 2)), DoublePack(__builtin_shufflevector(a[1], b[1], 1, 3))};
#endif
}

/// Pairs of records.
struct PairPack {
  DoublePack x, y, z;           ///< of the first less those of the second
  DoublePack sum_w, product_w;  ///< of both
  DoublePack first_w;
};
/// Subtracts before it transposes, which saves half the shuffles.
inline PairPack gathered(const Record* records, const std::uint32_t* first, const std::uint32_t* second) {
#if defined(__AVX512F__) || defined(__AVX__)
  using simd::Vector;
#ifdef __AVX512F__
  static constexpr Vector signs{-1, -1, -1, 1, -1, -1, -1, 1};
  const auto row = [&](const std::uint32_t* which, std::size_t lane) { return simd::joined(records[which[lane]], records[which[lane + 4]]); };
#else
  static constexpr Vector signs{-1, -1, -1, 1};
  const auto row = [&](const std::uint32_t* which, std::size_t lane) { return static_cast<Vector>(as_vector(records[which[lane]])); };
#endif
  const Vector a = row(first, 0), b = row(first, 1), c = row(first, 2), d = row(first, 3);
  const Vector e = row(second, 0), f = row(second, 1), g = row(second, 2), h = row(second, 3);
  RecordPack rows = simd::transposed(a + signs * e, b + signs * f, c + signs * g, d + signs * h);
  return {rows.x, rows.y, rows.z, rows.w, simd::transposed(a * e, b * f, c * g, d * h).w, simd::transposed(a, b, c, d).w};
#else
  RecordPack a = gathered(records, first), b = gathered(records, second);
  return {a.x - b.x, a.y - b.y, a.z - b.z, a.w + b.w, a.w * b.w, a.w};
#endif
}

/// Records that lie one after another.
inline RecordPack loaded(const Record* records) {
  static constexpr std::uint32_t all[] = {0, 1, 2, 3, 4, 5, 6, 7};
  return gathered(records, all);
}

/// Adds to the records of the first `count` lanes, one after another, since lanes may share a record.
inline void add_to(Record* records, const std::uint32_t* which, std::size_t count, const RecordPack& values) {
  const simd::Rows rows(values);
  simd::for_each_lane(count, [&](std::size_t lane) { rows.of(lane, [&](const auto& row) { simd::add(records[which[lane]], row); }); });
}
/// Writes `count` records one after another.
inline void write(Record* records, std::size_t count, const RecordPack& values) {
  const simd::Rows rows(values);
  simd::for_each_lane(count, [&](std::size_t lane) { rows.of(lane, [&](const auto& row) { simd::put(records[lane], row); }); });
}

}  // namespace acopla::dem
