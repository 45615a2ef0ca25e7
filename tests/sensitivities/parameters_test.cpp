#include <Eigen/Dense>
#include <diracstep/sensitivities/sensitivities.hpp>

#include "derivatives.hpp"

namespace diracstep {
namespace {

using namespace testing;

constexpr int with_parameters = 6;  // three coordinates, three parameters

/// The particle of the law scenes with a mass, a stiffness and the pitch of its rows as parameters.
template <class T>
T energy_of(const T& x, const T& y, const T& z, const T& vx, const T& vy, const T& vz, const T& mass,
            const T& stiffness) {
  using std::cos;
  return 0.5 * ((mass + 0.1 * x * x) * vx * vx + mass * vy * vy + 2.0 * vz * vz) + 0.2 * vx * vy * cos(z) -
         0.5 * stiffness * (x * x + y * y + z * z) - 0.1 * mass * x * x * z * z;
}
template <class T>
T sphere_of(const T& x, const T& y, const T& z, const T& pitch) {
  return x * x + pitch * y * y + 0.5 * z * z - 1.25 - 0.25 * pitch;
}

const Vector& usual() {
  static const Vector values{{1.0, 1.2, 0.8}};
  return values;
}

struct Kind {
  const char* name;
  bool sphere, contact, force;
};

Vector start_position(const Vector& theta) { return Vector{{1.0, 0.5, std::sqrt(0.5)}} + 0.0 * theta; }

template <int N, class Get>
Scene functions_of(const Kind& kind, Get parameter) {
  Scene scene;
  scene.name = kind.name;
  scene.coordinates = {"x", "y", "z"};
  for (int i = 3; i < N; ++i) scene.coordinates.push_back("theta" + std::to_string(i));
  scene.lagrangian = lagrangian<N>([parameter](const auto& q, const auto& v) {
    using T = std::decay_t<decltype(q[0])>;
    T sum = energy_of<T>(q[0], q[1], q[2], v[0], v[1], v[2], parameter(q, 0), parameter(q, 1));
    for (std::size_t i = 3; i < N; ++i) sum += 0.5 * v[i] * v[i];
    return sum;
  });
  if (kind.sphere)
    scene.constraints.push_back(holonomic<N, 1>(
        [parameter]<class T>(const std::array<T, N>& q) {
          return std::array<T, 1>{sphere_of<T>(q[0], q[1], q[2], parameter(q, 2))};
        },
        {"sphere"}));
  if (kind.contact)
    scene.constraints.push_back(affine<N, 1>(
        [parameter]<class T>(const std::array<T, N>& q) {
          std::array<std::array<T, N>, 1> row{};
          row[0][0] = T(1.0);
          row[0][2] = parameter(q, 2) * (2.0 + q[1]);
          return row;
        },
        [parameter]<class T>(const std::array<T, N>& q) {
          return std::array<T, 1>{0.1 * parameter(q, 1) * q[2]};
        },
        {"contact"}));
  if (kind.force)
    scene.force = force<N>([parameter]<class T>(const std::array<T, N>& q, const std::array<T, N>& v) {
      std::array<T, N> f{};
      f[0] = -0.3 * parameter(q, 2) * v[0] * v[0] + 0.2 * q[1];
      f[1] = -0.4 * v[1] * q[0];
      f[2] = 0.1 * v[0] - parameter(q, 1) * v[2];
      return f;
    });
  return scene;
}

/// A consistent start for the usual parameters; the velocity is projected by hand.
Start start_for(const Scene& scene) {
  Start start{0.0, start_position(usual()), Vector{{0.3, -0.6, 0.2}}};
  if (scene.rows() == 0) return start;
  ConstraintsAtPoint rows(scene.constraints, 3);
  rows.evaluate(0.0, start.q);
  const Columns a = rows.pattern().full(rows.coefficients());
  Vector off(rows.rows());
  rows.velocity_residual(start.v, off);
  start.v -= a.transpose() * (a * a.transpose()).inverse() * off;
  return start;
}

std::shared_ptr<const Scene> scene_for(const Kind& kind, const Vector& theta) {
  Scene scene = functions_of<3>(kind, [theta](const auto&, int i) { return theta[i]; });
  scene.start = start_for(functions_of<3>(kind, [](const auto&, int i) { return usual()[i]; }));
  return std::make_shared<const Scene>(scene);
}

ParametricScene parametric(const Kind& kind) {
  ParametricScene result;
  result.scene = scene_for(kind, usual());
  Scene extended = functions_of<with_parameters>(
      kind, [](const auto& q, int i) { return q[3 + static_cast<std::size_t>(i)]; });
  extended.start = {0.0, join(result.scene->start.q, usual()), join(result.scene->start.v, Vector::Zero(3))};
  result.extended = std::make_shared<const Scene>(extended);
  result.parameters = usual();
  return result;
}

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all{{"free", false, false, false},
                                     {"forced", false, false, true},
                                     {"sphere", true, false, false},
                                     {"contact", false, true, true},
                                     {"both", true, true, true}};
  return all;
}

template <class Check>
void for_every_method(Check check) {
  for (const Kind& kind : kinds())
    for (const char* method : {"type1/gl:2", "type1/midpoint", "damped/radau:2", "type1/trapezoidal",
                               "type2/euler", "type3/legendre(type1/midpoint)", "type2/legendre(type1/left)"})
      for (const int limit : {40, 0}) {
        IntegratorOptions options{.method = method, .step = 0.05, .dense_limit = limit};
        SCOPED_TRACE(std::string(kind.name) + ", " + method + ", dense limit " + std::to_string(limit));
        check(kind, options);
      }
}

TEST(ParameterSensitivities, AreThoseOfDifferencesForEveryStepAndClass) {
  for_every_method([](const Kind& kind, const IntegratorOptions& options) {
    constexpr long steps = 4;
    const ParametricScene scene = parametric(kind);
    Integrator integrator = integrator_for(scene.scene, options);
    const StartPoint start = start_of(integrator);
    Sensitivities sensitivities(integrator, Registry::with_built_ins(), scene);
    EXPECT_EQ(scene.names(), (std::vector<std::string>{"theta3", "theta4", "theta5"}));
    Directions z = Directions::Zero(9, 3);
    z.middleRows(3, 3).setIdentity();
    ASSERT_TRUE(sensitivities.jvp(steps, z).ok());
    const ReadDirections read = sensitivities.read(z);
    for (int k = 0; k < 3; ++k) {
      const Vector approximate = difference([&](double s) {
        const Vector theta = usual() + s * Vector::Unit(3, k);
        Scene moved = *scene_for(kind, theta);
        IntegratorOptions lenient = options;
        lenient.project_start = true;  // the start is replaced below
        Integrator other = integrator_for(std::make_shared<const Scene>(moved), lenient);
        return end_of_steps(other, start, steps);
      });
      EXPECT_LT(distance(stacked(read, k), approximate), 1e-9) << "parameter " << k;
    }
  });
}

TEST(ParameterSensitivities, TheAdjointIsTheTranspose) {
  for_every_method([](const Kind& kind, const IntegratorOptions& options) {
    ParametricScene scene = parametric(kind);
    scene.start_q = some_vector(9, 0.2).reshaped(3, 3);
    scene.start_v = some_vector(9, 1.2).reshaped(3, 3);
    Integrator integrator = integrator_for(scene.scene, options);
    Sensitivities sensitivities(integrator, Registry::with_built_ins(), scene);
    const Snapshot start = integrator.save();
    Directions z = sensitivities.by_parameters();
    ASSERT_TRUE(sensitivities.jvp(5, z).ok());
    const ReadDirections read = sensitivities.read(z);
    ReadDirections weights{some_vector(3, 0.1), some_vector(3, 0.7), some_vector(3, 1.9)};
    const Columns forward =
        weights.q.transpose() * read.q + weights.v.transpose() * read.v + weights.p.transpose() * read.p;
    integrator.restore(start);
    const auto back = sensitivities.gradient(5, [&](long, const Sample&) { return weights; });
    EXPECT_LT((back.by_start.parameters.transpose() - forward).lpNorm<Eigen::Infinity>(),
              1e-12 * std::max(1.0, forward.lpNorm<Eigen::Infinity>()));
  });
}

}  // namespace
}  // namespace diracstep
