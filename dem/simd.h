// Packs of doubles. The only file that knows how: GCC's vector types, which become AVX-512, AVX or pairs of SSE2 registers, as the
// build has them. (std::experimental::simd has no gather and no permute.)
#pragma once

#include <cmath>
#include <cstdint>

#include "dem/particles.h"

#ifdef __AVX__
#include <immintrin.h>
#endif

namespace acopla::dem {

struct Mask4 {
  using Vector = long long __attribute__((vector_size(32)));
  Vector v;
  friend Mask4 operator&(const Mask4& a, const Mask4& b) { return {a.v & b.v}; }
};

struct Double4 {
  using Vector = double __attribute__((vector_size(32)));
  Vector v;
  Double4() = default;
  Double4(double all) : v{all, all, all, all} {}  // NOLINT: a scalar is meant to mix with vectors
  explicit Double4(const Vector& vector) : v(vector) {}
  double operator[](int lane) const { return v[lane]; }

  friend Double4 operator+(const Double4& a, const Double4& b) { return Double4(a.v + b.v); }
  friend Double4 operator-(const Double4& a, const Double4& b) { return Double4(a.v - b.v); }
  friend Double4 operator*(const Double4& a, const Double4& b) { return Double4(a.v * b.v); }
  friend Double4 operator/(const Double4& a, const Double4& b) { return Double4(a.v / b.v); }
  friend Double4 operator-(const Double4& a) { return Double4(-a.v); }
  friend Mask4 operator<(const Double4& a, const Double4& b) { return {a.v < b.v}; }
  friend Mask4 operator==(const Double4& a, const Double4& b) { return {a.v == b.v}; }
  friend Mask4 operator>(const Double4& a, const Double4& b) { return {a.v > b.v}; }
};

/// Contacts of a pack.
inline constexpr std::size_t lanes = 4;

/// Lane by lane: where the mask holds `yes`, else `no`. Both are computed.
inline Double4 select(const Mask4& mask, const Double4& yes, const Double4& no) { return Double4(mask.v ? yes.v : no.v); }
inline double select(bool mask, double yes, double no) { return mask ? yes : no; }

inline Double4 max(const Double4& a, const Double4& b) { return Double4(a.v > b.v ? a.v : b.v); }
inline Double4 min(const Double4& a, const Double4& b) { return Double4(a.v < b.v ? a.v : b.v); }

inline Double4 sqrt(const Double4& a) {
#ifdef __AVX__
  return Double4(static_cast<Double4::Vector>(_mm256_sqrt_pd(static_cast<__m256d>(a.v))));
#else
  return Double4(Double4::Vector{std::sqrt(a.v[0]), std::sqrt(a.v[1]), std::sqrt(a.v[2]), std::sqrt(a.v[3])});
#endif
}

inline double sum(const Double4& a) { return (a.v[0] + a.v[1]) + (a.v[2] + a.v[3]); }

/// Four records as four components: what four contacts need, in four loads and eight shuffles.
struct Record4 {
  Double4 x, y, z, w;
};

inline Record4 transposed(const Double4::Vector& a, const Double4::Vector& b, const Double4::Vector& c, const Double4::Vector& d) {
  const auto ab_even = __builtin_shufflevector(a, b, 0, 4, 2, 6), ab_odd = __builtin_shufflevector(a, b, 1, 5, 3, 7);
  const auto cd_even = __builtin_shufflevector(c, d, 0, 4, 2, 6), cd_odd = __builtin_shufflevector(c, d, 1, 5, 3, 7);
  return {Double4(__builtin_shufflevector(ab_even, cd_even, 0, 1, 4, 5)), Double4(__builtin_shufflevector(ab_odd, cd_odd, 0, 1, 4, 5)),
          Double4(__builtin_shufflevector(ab_even, cd_even, 2, 3, 6, 7)), Double4(__builtin_shufflevector(ab_odd, cd_odd, 2, 3, 6, 7))};
}

// A record is four aligned doubles, so it may be read and written as one vector.
using RecordVector = double __attribute__((vector_size(32), may_alias));
inline const RecordVector& as_vector(const Record& record) { return reinterpret_cast<const RecordVector&>(record); }
inline RecordVector& as_vector(Record& record) { return reinterpret_cast<RecordVector&>(record); }

inline Record4 gathered(const Record* records, const std::uint32_t* four) {
  return transposed(as_vector(records[four[0]]), as_vector(records[four[1]]), as_vector(records[four[2]]), as_vector(records[four[3]]));
}
inline Record4 loaded(const Record* four) { return transposed(as_vector(four[0]), as_vector(four[1]), as_vector(four[2]), as_vector(four[3])); }

/// Lanes from memory; `at` need not be aligned.
inline Double4 load(const double* at) {
  using Unaligned = double __attribute__((vector_size(32), aligned(8), may_alias));
  return Double4(*reinterpret_cast<const Unaligned*>(at));
}
inline void store(double* at, const Double4& value) {
  using Unaligned = double __attribute__((vector_size(32), aligned(8), may_alias));
  *reinterpret_cast<Unaligned*>(at) = value.v;
}

}  // namespace acopla::dem
