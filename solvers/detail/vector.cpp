#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/scales.hpp>
#include <diracstep/solvers/detail/vector.hpp>
#include <utility>

namespace diracstep::detail {

namespace {

/// Reductions go in so many strands: in a single one each addition waits for the last.
constexpr std::size_t strands = 4;

/// The operations that KINSOL calls, on N entries; N = 0 reads the length from the vector.
template <int N>
struct Operations {
  static long length([[maybe_unused]] N_Vector x) {
    if constexpr (N > 0)
      return N;
    else
      return static_cast<N_VectorContent_Serial>(x->content)->length;
  }

  /// z_i = entry(i).
  template <class Entry>
  static void fill(N_Vector z, Entry entry) {
    double *const to = data_of(z);
    const long n = length(z);
    for (long i = 0; i < n; ++i) to[i] = entry(i);
  }

  /// KINSOL clears the unknowns of a linear system first, which a direct solver overwrites.
  static void constant(sunrealtype, N_Vector) {}
  static void scale(sunrealtype c, N_Vector x, N_Vector z) {
    const double *const a = data_of(x);
    fill(z, [=](long i) { return c * a[i]; });
  }
  static void linear_sum(sunrealtype c, N_Vector x, sunrealtype d, N_Vector y, N_Vector z) {
    const double *const a = data_of(x), *const b = data_of(y);
    fill(z, [=](long i) { return c * a[i] + d * b[i]; });
  }
  static void product(N_Vector x, N_Vector y, N_Vector z) {
    const double *const a = data_of(x), *const b = data_of(y);
    fill(z, [=](long i) { return a[i] * b[i]; });
  }
  static void quotient(N_Vector x, N_Vector y, N_Vector z) {
    const double *const a = data_of(x), *const b = data_of(y);
    fill(z, [=](long i) { return a[i] / b[i]; });
  }
  static void absolute(N_Vector x, N_Vector z) {
    const double *const a = data_of(x);
    fill(z, [=](long i) { return std::abs(a[i]); });
  }
  static void inverse(N_Vector x, N_Vector z) {
    const double *const a = data_of(x);
    fill(z, [=](long i) { return 1.0 / a[i]; });
  }
  static sunrealtype max_norm(N_Vector x) { return largest_entry(data_of(x), length(x)); }
  static sunrealtype minimum(N_Vector x) {
    const double *const a = data_of(x);
    return *std::min_element(a, a + length(x));
  }
  static sunrealtype dot(N_Vector x, N_Vector y) {
    const double *const a = data_of(x), *const b = data_of(y);
    const long n = length(x);
    double sum = 0.0;
    for (long i = 0; i < n; ++i) sum += a[i] * b[i];
    return sum;
  }
  static sunrealtype weighted_norm(N_Vector x, N_Vector w) {
    const double *const a = data_of(x), *const b = data_of(w);
    const long n = length(x);
    std::array<double, strands> sum{};
    const long whole = n - n % static_cast<long>(strands);
    for (long i = 0; i < whole; i += strands)
      for (std::size_t s = 0; s < strands; ++s) {
        const double term = a[i + static_cast<long>(s)] * b[i + static_cast<long>(s)];
        sum[s] += term * term;
      }
    for (long i = whole; i < n; ++i)
      sum[static_cast<std::size_t>(i - whole)] += (a[i] * b[i]) * (a[i] * b[i]);
    return std::sqrt(sum[0] + sum[1] + sum[2] + sum[3]);
  }

  static void install(_generic_N_Vector_Ops &ops) {
    ops.nvconst = constant;
    ops.nvscale = scale;
    ops.nvlinearsum = linear_sum;
    ops.nvprod = product;
    ops.nvdiv = quotient;
    ops.nvabs = absolute;
    ops.nvinv = inverse;
    ops.nvmaxnorm = max_norm;
    ops.nvmin = minimum;
    ops.nvdotprod = dot;
    ops.nvwl2norm = weighted_norm;
  }
};

constexpr std::size_t longest_fixed = 16;

template <std::size_t... N>
constexpr auto installers(std::index_sequence<N...>) {
  return std::array{&Operations<static_cast<int>(N)>::install...};
}

}  // namespace

VectorHandle make_view(int size, SUNContext context) {
  static constexpr auto install = installers(std::make_index_sequence<longest_fixed + 1>());
  VectorHandle x(require(N_VNewEmpty_Serial(size, context), "N_VNewEmpty_Serial"));
  const auto length = static_cast<std::size_t>(size);
  install.at(length <= longest_fixed ? length : 0)(*x->ops);
  return x;
}

}  // namespace diracstep::detail
