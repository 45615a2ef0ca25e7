#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/solvers/detail/vector.hpp>
#include <utility>

namespace diracstep::detail {

namespace {

/// Sums go in so many strands: in a single one each addition waits for the last.
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
    for (long i = 0; i < n; ++i) sum[i % strands] += (a[i] * b[i]) * (a[i] * b[i]);
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

/// Weights of a long vector, and what KINSOL does with them.  In each operation on a long vector that takes
/// weights they are such ones.
struct Weights {
  std::array<Run, 4> runs{};
  std::size_t count = 0;
  const double *scales = nullptr;  ///< of every entry; null where the runs say all
  long length = 0;

  static Weights &of(N_Vector w) { return *static_cast<Weights *>(w->content); }
  static bool are(N_Vector w) { return w->ops->nvmin == minimum; }

  /// Calls visit(first, behind the last, weight) for each run.
  template <class Visit>
  static void for_each(N_Vector w, Visit visit) {
    const Weights &weights = of(w);
    for (long i = 0; weights.scales != nullptr && i < weights.length; ++i)
      visit(i, i + 1, 1.0 / weights.scales[i]);
    long first = 0;
    for (const Run &run : std::span(weights.runs).first(weights.count)) {
      visit(first, first + run.length, run.value);
      first += run.length;
    }
  }

  static sunrealtype minimum(N_Vector w) {
    double least = HUGE_VAL;
    for_each(w, [&](long, long, double value) { least = std::min(least, value); });
    return least;
  }
  static void inverse(N_Vector w, N_Vector z) {
    for_each(w,
             [to = data_of(z)](long i, long end, double value) { std::fill(to + i, to + end, 1.0 / value); });
  }
  /// Either factor is the weights.
  static void product(N_Vector x, N_Vector w, N_Vector z) {
    if (are(x)) std::swap(x, w);
    for_each(w, [a = data_of(x), to = data_of(z)](long i, long end, double value) {
      for (; i < end; ++i) to[i] = a[i] * value;
    });
  }
  static sunrealtype norm(N_Vector x, N_Vector w) {
    double sum = 0.0;
    for_each(w, [&, a = data_of(x)](long first, long end, double value) {
      std::array<double, 2 * strands> part{};
      long i = first;
      for (; i + static_cast<long>(part.size()) <= end; i += static_cast<long>(part.size()))
        for (std::size_t s = 0; s < part.size(); ++s) {
          const double term = a[i + static_cast<long>(s)] * value;
          part[s] += term * term;
        }
      for (; i < end; ++i) sum += (a[i] * value) * (a[i] * value);
      for (const double of : part) sum += of;
    });
    return std::sqrt(sum);
  }
};

template <std::size_t... N>
constexpr auto installers(std::index_sequence<N...>) {
  return std::array{&Operations<static_cast<int>(N)>::install...};
}

/// N_VClone of SUNDIALS 6.4 and 6.5 follows the null pointer it gets where memory is short.
N_Vector clone(N_Vector vector) {
  N_Vector copy = vector->ops->nvclone(vector);
  if (copy != nullptr) copy->sunctx = vector->sunctx;
  return copy;
}

}  // namespace

VectorHandle make_view(int size, SUNContext context) {
  static constexpr auto install = installers(std::make_index_sequence<longest_fixed + 1>());
  VectorHandle x(require(N_VNewEmpty_Serial(size, context), "N_VNewEmpty_Serial"));
  const auto length = static_cast<std::size_t>(size);
  install.at(length <= longest_fixed ? length : 0)(*x->ops);
  if (length > longest_fixed) {
    x->ops->nvinv = Weights::inverse;
    x->ops->nvprod = Weights::product;
    x->ops->nvwl2norm = Weights::norm;
  }
  return x;
}

VectorHandle make_weights(N_Vector vector) {
  if (N_VGetLength(vector) <= static_cast<long>(longest_fixed))
    return VectorHandle(require(clone(vector), "N_VClone"));
  VectorHandle w(require(N_VNewEmpty(vector->sunctx), "N_VNewEmpty"));
  auto *const content = new Weights;  // NOLINT(cppcoreguidelines-owning-memory): nvdestroy deletes it
  content->length = N_VGetLength(vector);
  w->content = content;
  w->ops->nvdestroy = [](N_Vector v) {
    delete static_cast<Weights *>(v->content);  // NOLINT(cppcoreguidelines-owning-memory)
    N_VFreeEmpty(v);
  };
  w->ops->nvmin = Weights::minimum;
  return w;
}

void set_weights(N_Vector weights, std::span<const Run> runs) {
  if (Weights::are(weights)) {
    Weights::of(weights).scales = nullptr;
    Weights::of(weights).count = runs.size();
    std::ranges::copy(runs, Weights::of(weights).runs.begin());
    return;
  }
  double *to = data_of(weights);
  for (const Run &run : runs) to = std::fill_n(to, run.length, run.value);
}

void set_weights(N_Vector weights, const double *scales) {
  if (Weights::are(weights)) {
    Weights::of(weights).scales = scales;
    Weights::of(weights).count = 0;
    return;
  }
  const long length = N_VGetLength(weights);
  for (long i = 0; i < length; ++i) data_of(weights)[i] = 1.0 / scales[i];
}

}  // namespace diracstep::detail
