#include <array>
#include <cmath>
#include <diracstep/scene_format/compiler/special_functions.hpp>
#include <limits>
#include <numbers>

namespace diracstep::scene_compiler {

namespace {

constexpr long double pi = std::numbers::pi_v<long double>;
constexpr long double undefined = std::numeric_limits<long double>::quiet_NaN();

}  // namespace

long double kepler_anomaly(long double t, long double e) {
  if (!(e >= 0.0L && e < 1.0L) || !std::isfinite(t)) return undefined;
  const long double mean = std::remainder(t, 2.0L * pi);
  long double low = mean < 0.0L ? -pi : 0.0L, high = mean < 0.0L ? 0.0L : pi;
  long double anomaly = mean < 0.0L ? mean - e / 2.0L : mean + e / 2.0L;
  for (int i = 0; i < 100; ++i) {
    const long double residual = anomaly - e * std::sin(anomaly) - mean;
    (residual > 0.0L ? high : low) = anomaly;
    long double next = anomaly - residual / (1.0L - e * std::cos(anomaly));
    if (!(next >= low && next <= high)) next = (low + high) / 2.0L;  // Newton left the bracket
    const long double change = next - anomaly;
    anomaly = next;
    if (std::abs(change) < 1e-19L) break;
  }
  return anomaly;
}

JacobiElliptic jacobi_elliptic(long double u, long double k) {
  if (!(k >= 0.0L && k < 1.0L) || !std::isfinite(u)) return {undefined, undefined, undefined};
  constexpr std::size_t levels = 10;
  const long double complement = std::sqrt((1.0L - k) * (1.0L + k));
  std::array<long double, levels> a{1.0L}, c{k};
  long double b = complement, scale = 1.0L;
  for (std::size_t i = 1; i < levels; ++i, scale *= 2.0L) {
    a[i] = (a[i - 1] + b) / 2.0L;
    c[i] = (a[i - 1] - b) / 2.0L;
    b = std::sqrt(a[i - 1] * b);
  }
  const long double mean = a[levels - 1], quarter_period = pi / (2.0L * mean);
  u = std::remainder(u, 4.0L * quarter_period);
  long double angle = scale * mean * u;
  for (std::size_t i = levels - 1; i > 0; --i)
    angle = (angle + std::asin(c[i] / a[i] * std::sin(angle))) / 2.0L;
  const long double sn = std::sin(angle), cn = std::cos(angle);
  return {sn, cn, std::sqrt(cn * cn + complement * complement * sn * sn)};
}

}  // namespace diracstep::scene_compiler
