#include "group_scenes.hpp"

namespace diracstep::group_scenes {

template <Retraction kind>
std::shared_ptr<const Space> rotations() {
  return space(spaces::RotationsBy<kind>{});
}
template std::shared_ptr<const Space> rotations<Retraction::exponential>();
template std::shared_ptr<const Space> rotations<Retraction::cayley>();

static auto top_lagrangian() {
  return lagrangian<4>(
      [J = generic_inertia()]<class T>(const std::array<T, 4>& q, const std::array<T, 4>& w) {
        const auto R = matrix_of<4>(q);
        T value = quadratic<T>(J, {w[0], w[1], w[2]});
        for (std::size_t i = 0; i < 3; ++i) value -= top_k[i] * R[2][i] + 0.5 * top_K[i] * R[2][i] * R[2][i];
        return value;
      });
}
GroupScene heavy_top(const std::shared_ptr<const Space>& space) {
  auto scene = scene_of("heavy top", std::move(space), top_lagrangian(), generic_rotation(),
                        (Vector(3) << 0.6, -1.2, 1.4).finished());
  const auto rates = [J = generic_inertia()](const Column& y) {
    Column rate(12);
    const V3 w = three(y, 9), torque = plus(cross(times(J, w), w), top_torque(y));
    turn(y, w, rate);
    const ExtendedVector a =
        solved(J.cast<Real>(), (ExtendedVector(3) << torque[0], torque[1], torque[2]).finished());
    for (int i = 0; i < 3; ++i) rate[9 + static_cast<std::size_t>(i)] = a[i];
    return rate;
  };
  return {"heavy top", scene, entries, rates};
}

GroupScene driven_top(const std::shared_ptr<const Space>& space) {
  GroupScene top = heavy_top(space);
  auto scene = std::make_shared<Scene>(*top.scene);
  scene->name = top.name = "driven top";
  scene->force =
      on_space(space, force<4>([]<class T>(const std::array<T, 4>&, const std::array<T, 4>& w, const T& t) {
                 return std::array<T, 4>{-0.3 * w[0] + 0.5 * sin(2.0 * t), -0.2 * w[1], T(0.1), T(0.0)};
               }));
  top.scene = scene;
  top.rates = [J = generic_inertia(), free = top.rates](const Column& y) {
    Column rate = free(y);
    rate.resize(12);
    const Real t = y.size() > 12 ? y[12] : Real(0);
    const ExtendedVector a = solved(
        J.cast<Real>(),
        (ExtendedVector(3) << Real(0.5) * std::sin(2 * t) - Real(0.3) * y[9], -Real(0.2) * y[10], Real(0.1))
            .finished());
    for (int i = 0; i < 3; ++i) rate[9 + static_cast<std::size_t>(i)] += a[i];
    if (y.size() > 12) rate.push_back(1);
    return rate;
  };
  return top;
}

GroupScene suslov(const std::shared_ptr<const Space>& space) {
  constexpr std::array<double, 3> a{0.2, -0.3, 1.0};
  auto scene = scene_of("Suslov with gravity", space, top_lagrangian(), generic_rotation(),
                        (Vector(3) << 0.9, -1.1, -0.51).finished());
  scene->constraints = {
      on_space(space, pfaffian<4, 1>([=]<class T>(const std::array<T, 4>&) {
                 return std::array<std::array<T, 4>, 1>{{{T(a[0]), T(a[1]), T(a[2]), T(0.0)}}};
               }))};
  const auto rates = [J = generic_inertia(), a](const Column& y) {
    Column rate(12);
    const V3 w = three(y, 9), torque = plus(cross(times(J, w), w), top_torque(y));
    turn(y, w, rate);
    ExtendedMatrix m = ExtendedMatrix::Zero(4, 4);
    m.topLeftCorner(3, 3) = J.cast<Real>();
    for (int i = 0; i < 3; ++i) m(i, 3) = m(3, i) = Real(a[static_cast<std::size_t>(i)]);
    const ExtendedVector x =
        solved(m, (ExtendedVector(4) << torque[0], torque[1], torque[2], Real(0)).finished());
    for (int i = 0; i < 3; ++i) rate[9 + static_cast<std::size_t>(i)] = x[i];
    return rate;
  };
  return {"Suslov with gravity", scene, entries, rates};
}

/// A rolling ball of radius 0.7 whose centre of mass is off its centre, on a spring to the origin; SO3 x R2.
template <Retraction kind>
GroupScene chaplygin_ball() {
  static constexpr double radius = 0.7, mass = 1.3, gravity = 2.0, stiffness = 0.8;
  static constexpr std::array<double, 3> off{0.1, -0.06, 0.15};
  const auto on = space(spaces::RotationsBy<kind>{}, spaces::R<2>{});
  auto formula = lagrangian<6>([J = generic_inertia()]<class T>(const std::array<T, 6>& q,
                                                                const std::array<T, 6>& v) {
    const auto R = matrix_of<6>(q);
    const std::array<T, 3> w{v[0], v[1], v[2]},
        lever{w[1] * off[2] - w[2] * off[1], w[2] * off[0] - w[0] * off[2], w[0] * off[1] - w[1] * off[0]};
    T value = quadratic<T>(J, w) - 0.5 * stiffness * (q[4] * q[4] + q[5] * q[5]);
    for (std::size_t i = 0; i < 3; ++i) {
      const T speed =
          R[i][0] * lever[0] + R[i][1] * lever[1] + R[i][2] * lever[2] + (i < 2 ? v[3 + i] : T(0.0));
      value += 0.5 * mass * speed * speed - mass * gravity * off[i] * R[2][i];
    }
    return value;
  });
  Vector q(6), v(5);
  q << generic_rotation(), 0.4, -0.3;
  q = on->normalised(q);
  v << 0.8, -0.5, 1.1, 0.0, 0.0;
  const auto R = spaces::rotation_matrix(q[0], q[1], q[2], q[3]);
  v[3] = radius * (R[1][0] * v[0] + R[1][1] * v[1] + R[1][2] * v[2]);
  v[4] = -radius * (R[0][0] * v[0] + R[0][1] * v[1] + R[0][2] * v[2]);
  auto scene = scene_of("Chaplygin ball", on, formula, q, v);
  scene->constraints = {
      on_space(on, pfaffian<6, 2>([]<class T>(const std::array<T, 6>& at) {
                 const auto M = matrix_of<6>(at);
                 return std::array<std::array<T, 6>, 2>{
                     {{-radius * M[1][0], -radius * M[1][1], -radius * M[1][2], T(1.0), T(0.0), T(0.0)},
                      {radius * M[0][0], radius * M[0][1], radius * M[0][2], T(0.0), T(1.0), T(0.0)}}};
               }))};
  const auto rates = [J = generic_inertia()](const Column& y) {
    Column rate(16);
    const V3 w = three(y, 11), rho{off[0], off[1], off[2]}, lever = cross(w, rho);
    const V3 u = to_body(y, {y[14], y[15], 0}), gamma{y[6], y[7], y[8]};
    turn(y, w, rate);
    rate[9] = y[14];
    rate[10] = y[15];
    // π = Jω + m ρ×(u + ω×ρ);  π' = π×ω + (ω×ρ)×m u + γ×(m g ρ)
    const V3 pi = plus(times(J, w), cross(rho, plus(u, lever)), mass);
    V3 torque = plus(plus(cross(pi, w), cross(lever, u), mass), cross(gamma, rho), Real(mass) * gravity);
    torque = plus(torque, cross(rho, cross(w, u)), mass);  // the part of π' without accelerations
    // d/dt of m (x' + R(ω×ρ)) without accelerations: m R(ω×(ω×ρ))
    const V3 pull = to_space(y, cross(w, lever));
    ExtendedMatrix m = ExtendedMatrix::Zero(7, 7);
    ExtendedVector b(7);
    for (int j = 0; j < 3; ++j) {
      V3 e{};
      e[static_cast<std::size_t>(j)] = 1;
      const V3 turned = plus(times(J, e), cross(rho, cross(e, rho)), mass),
               swung = to_space(y, cross(e, rho)), spatial = to_space(y, e);
      for (int i = 0; i < 3; ++i) m(i, j) = turned[static_cast<std::size_t>(i)];
      m(3, j) = Real(mass) * swung[0];
      m(4, j) = Real(mass) * swung[1];
      m(5, j) = -Real(radius) * spatial[1];
      m(6, j) = Real(radius) * spatial[0];
    }
    m(3, 3) = m(4, 4) = mass;
    m(5, 3) = m(6, 4) = 1;
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 3; ++j) m(j, 3 + i) = m(3 + i, j);
    for (int r = 5; r < 7; ++r)
      for (int j = 0; j < 5; ++j) m(j, r) = -m(r, j);
    for (int i = 0; i < 3; ++i) b[i] = torque[static_cast<std::size_t>(i)];
    b[3] = -Real(stiffness) * y[9] - Real(mass) * pull[0];
    b[4] = -Real(stiffness) * y[10] - Real(mass) * pull[1];
    b[5] = b[6] = 0;  // (Rω)' = Rω'
    const ExtendedVector x = solved(m, b);
    for (int i = 0; i < 5; ++i) rate[11 + static_cast<std::size_t>(i)] = x[i];
    return rate;
  };
  return {"Chaplygin ball", scene, entries, rates};
}

/// A top whose centre of mass x = R r is a coordinate of its own with three holonomic rows; SO3 x R3.
template <Retraction kind>
GroupScene top_with_rows() {
  static constexpr double mass = 1.2, gravity = 1.5;
  static constexpr std::array<double, 3> arm{0.2, -0.1, 0.6};
  const auto on = space(spaces::RotationsBy<kind>{}, spaces::R<3>{});
  auto formula =
      lagrangian<7>([J = generic_inertia()]<class T>(const std::array<T, 7>& q, const std::array<T, 7>& v) {
        return quadratic<T>(J, {v[0], v[1], v[2]}) + 0.5 * mass * (v[3] * v[3] + v[4] * v[4] + v[5] * v[5]) -
               mass * gravity * q[6];
      });
  Vector q(7), v(6);
  q << generic_rotation(), 0.0, 0.0, 0.0;
  q = on->normalised(q);
  v << 0.6, -1.2, 1.4, 0.0, 0.0, 0.0;
  const auto R = spaces::rotation_matrix(q[0], q[1], q[2], q[3]);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    q[4 + k] = R[i][0] * arm[0] + R[i][1] * arm[1] + R[i][2] * arm[2];
    v[3 + k] = R[i][0] * (v[1] * arm[2] - v[2] * arm[1]) + R[i][1] * (v[2] * arm[0] - v[0] * arm[2]) +
               R[i][2] * (v[0] * arm[1] - v[1] * arm[0]);
  }
  auto scene = scene_of("top with rows", on, formula, q, v);
  scene->constraints = {on_space(on, holonomic<7, 3>([]<class T>(const std::array<T, 7>& at) {
                                   const auto M = matrix_of<7>(at);
                                   std::array<T, 3> phi;
                                   for (std::size_t i = 0; i < 3; ++i)
                                     phi[i] =
                                         at[4 + i] - (M[i][0] * arm[0] + M[i][1] * arm[1] + M[i][2] * arm[2]);
                                   return phi;
                                 }))};
  const auto rates = [J = generic_inertia()](const Column& y) {
    Column rate(18);
    const V3 w = three(y, 12), r{arm[0], arm[1], arm[2]}, gamma{y[6], y[7], y[8]};
    ExtendedMatrix whole(3, 3);
    for (int j = 0; j < 3; ++j) {
      V3 e{};
      e[static_cast<std::size_t>(j)] = 1;
      const V3 column = plus(times(J, e), cross(r, cross(e, r)), mass);
      for (int i = 0; i < 3; ++i) whole(i, j) = column[static_cast<std::size_t>(i)];
    }
    const V3 pi = plus(times(J, w), cross(r, cross(w, r)), mass);
    const V3 torque = plus(cross(pi, w), cross(gamma, r), Real(mass) * gravity);
    const ExtendedVector a = solved(whole, (ExtendedVector(3) << torque[0], torque[1], torque[2]).finished());
    turn(y, w, rate);
    const V3 wa{a[0], a[1], a[2]}, bent = to_space(y, plus(cross(wa, r), cross(w, cross(w, r))));
    for (std::size_t i = 0; i < 3; ++i) {
      rate[9 + i] = y[15 + i];
      rate[12 + i] = wa[i];
      rate[15 + i] = bent[i];
    }
    return rate;
  };
  return {"top with rows", scene, entries, rates};
}

/// A sleigh on a slope, SE2: its blade along the first axis of the body, its centre of mass off the blade.
template <Retraction kind>
GroupScene sleigh() {
  static constexpr double mass = 1.4, inertia = 0.5, ahead = 0.3, beside = 0.1, slope = 0.9;
  const auto on = space(spaces::PlaneMotionsBy<kind>{});
  auto formula = lagrangian<4>([]<class T>(const std::array<T, 4>& q, const std::array<T, 4>& v) {
    const T along = v[1] - beside * v[0], across = v[2] + ahead * v[0];
    const T height = q[2] + ahead * q[0] - beside * q[1];
    return 0.5 * mass * (along * along + across * across) + 0.5 * inertia * v[0] * v[0] -
           mass * slope * height;
  });
  auto scene = scene_of("sleigh", on, formula, (Vector(4) << 0.8, 0.6, 0.2, -0.1).finished(),
                        (Vector(3) << 1.1, 0.7, 0.0).finished());
  scene->constraints = {on_space(on, pfaffian<4, 1>([]<class T>(const std::array<T, 4>&) {
                                   return std::array<std::array<T, 4>, 1>{{{T(0.0), T(0.0), T(1.0), T(0.0)}}};
                                 }))};
  const auto observe = [](const Vector& q, const Vector& v) {
    Vector all(7);
    all << q, v;
    return all;
  };
  const auto rates = [](const Column& y) {
    const Real c = y[0], s = y[1], w = y[4], u = y[5], z = y[6];
    const Real p1 = mass * (u - Real(beside) * w), p2 = mass * (z + Real(ahead) * w);
    const Real f1 = -Real(mass) * slope * c, f2 = Real(mass) * slope * s;
    const Real f0 = Real(ahead) * f2 - Real(beside) * f1;
    ExtendedMatrix m(3, 3);
    m << Real(inertia) + Real(mass) * (Real(ahead) * ahead + Real(beside) * beside), -Real(mass) * beside, 0,
        -Real(mass) * beside, mass, 0, Real(mass) * ahead, 0, -1;  // ω', u', Λ, with z' = 0
    ExtendedVector b(3);
    b << p1 * z - p2 * u + f0, p2 * w + f1, -p1 * w + f2;
    const ExtendedVector x = solved(m, b);
    return Column{-s * w, c * w, c * u - s * z, s * u + c * z, x[0], x[1], Real(0)};
  };
  return {"sleigh", scene, observe, rates};
}

/// A body on a spring, SE3.
template <Retraction kind>
GroupScene body_on_spring() {
  static constexpr double mass = 1.1, stiffness = 2.5;
  static constexpr std::array<double, 3> hook{0.3, 0.2, -0.4}, anchor{0.1, -0.5, 0.6};
  const auto on = space(spaces::MotionsBy<kind>{});
  auto formula = lagrangian<7>([J = generic_inertia()]<class T>(const std::array<T, 7>& q,
                                                                const std::array<T, 7>& v) {
    const auto R = matrix_of<7>(q);
    T value = quadratic<T>(J, {v[0], v[1], v[2]}) + 0.5 * mass * (v[3] * v[3] + v[4] * v[4] + v[5] * v[5]);
    for (std::size_t i = 0; i < 3; ++i) {
      const T stretch = q[4 + i] + R[i][0] * hook[0] + R[i][1] * hook[1] + R[i][2] * hook[2] - anchor[i];
      value -= 0.5 * stiffness * stretch * stretch;
    }
    return value;
  });
  auto scene =
      scene_of("body on a spring", on, formula, (Vector(7) << generic_rotation(), 0.5, -0.4, 0.3).finished(),
               (Vector(6) << 0.9, -1.1, 0.7, 0.3, 0.5, -0.6).finished());
  const auto rates = [J = generic_inertia()](const Column& y) {
    Column rate(18);
    const V3 w = three(y, 12), u = three(y, 15), h{hook[0], hook[1], hook[2]}, x = three(y, 9);
    const V3 stretch = plus(plus(x, to_space(y, h)), {anchor[0], anchor[1], anchor[2]}, -1);
    const V3 pull = to_body(
        y, {-Real(stiffness) * stretch[0], -Real(stiffness) * stretch[1], -Real(stiffness) * stretch[2]});
    const V3 torque = plus(cross(times(J, w), w), cross(h, pull));
    turn(y, w, rate);
    const V3 moved = to_space(y, u), force = plus(cross(u, w), pull, 1 / Real(mass));
    const ExtendedVector a =
        solved(J.cast<Real>(), (ExtendedVector(3) << torque[0], torque[1], torque[2]).finished());
    for (std::size_t i = 0; i < 3; ++i) {
      rate[9 + i] = moved[i];
      rate[12 + i] = a[static_cast<Eigen::Index>(i)];
      rate[15 + i] = force[i];
    }
    return rate;
  };
  return {"body on a spring", scene, entries, rates};
}

/// A spherical pendulum with a further well, S2.
template <Retraction kind>
GroupScene pendulum_on_sphere() {
  static constexpr double gravity = 1.3, depth = 0.6;
  static constexpr std::array<double, 3> well{0.8, 0.0, 0.6};
  const auto on = space(spaces::SphereBy<kind>{});
  auto formula = lagrangian<4>([]<class T>(const std::array<T, 4>& q, const std::array<T, 4>& w) {
    const auto R = matrix_of<4>(q);
    const T to_well = R[0][2] * well[0] + R[1][2] * well[1] + R[2][2] * well[2];
    return 0.5 * (w[0] * w[0] + w[1] * w[1]) - gravity * R[2][2] + depth * exp(2.0 * (to_well - 1.0));
  });
  auto scene =
      scene_of("pendulum on a sphere", on, formula, generic_rotation(), (Vector(2) << 1.3, -0.9).finished());
  const auto observe = [](const Vector& q, const Vector& v) {
    const auto R = spaces::rotation_matrix(q[0], q[1], q[2], q[3]);
    Vector all(6);
    for (std::size_t i = 0; i < 3; ++i) {
      all[static_cast<Eigen::Index>(i)] = R[i][2];
      all[static_cast<Eigen::Index>(i) + 3] = R[i][0] * v[1] - R[i][1] * v[0];
    }
    return all;
  };
  const auto rates = [](const Column& y) {
    const V3 q = three(y, 0), u = three(y, 3), d{well[0], well[1], well[2]};
    const Real pull = 2 * Real(depth) * std::exp(2 * (dot(q, d) - 1));
    V3 force{pull * d[0], pull * d[1], pull * d[2] - Real(gravity)};
    force = plus(force, q, -dot(force, q) - dot(u, u));
    return Column{u[0], u[1], u[2], force[0], force[1], force[2]};
  };
  return {"pendulum on a sphere", scene, observe, rates};
}

/// y(T) by the explicit midpoint rule with Gragg's start, extrapolated in h² over eight rows, in `steps`
/// equal steps.
static Column extrapolated(const Rates& f, Column y, Real T, int steps) {
  constexpr int rows = 8;
  const Real H = T / steps;
  const std::size_t n = y.size();
  for (int step = 0; step < steps; ++step) {
    std::array<Column, rows> table;
    for (int r = 0; r < rows; ++r) {
      const int parts = 2 * (r + 1);
      const Real h = H / parts;
      Column last = y, now(n), rate = f(y);
      for (std::size_t i = 0; i < n; ++i) now[i] = y[i] + h * rate[i];
      for (int k = 1; k < parts; ++k) {
        rate = f(now);
        for (std::size_t i = 0; i < n; ++i) {
          const Real next = last[i] + 2 * h * rate[i];
          last[i] = now[i];
          now[i] = next;
        }
      }
      Column row = now;
      for (int k = 1; k <= r; ++k) {
        const Real ratio = Real(r + 1) / Real(r + 1 - k);
        Column next(n);
        Column& before = table[static_cast<std::size_t>(k - 1)];
        for (std::size_t i = 0; i < n; ++i) next[i] = row[i] + (row[i] - before[i]) / (ratio * ratio - 1);
        before = row;
        row = next;
      }
      table[static_cast<std::size_t>(r)] = row;
    }
    y = table[rows - 1];
  }
  return y;
}

/// What is compared at t = T, by hand.
Vector reference(const GroupScene& of, double T, int steps) {
  const Start& start = of.scene->start;
  const Vector first = of.observe(start.q, start.v);
  Column from(first.begin(), first.end());
  if (of.scene->force) from.push_back(start.time);
  const Column end = extrapolated(of.rates, from, T, steps);
  Vector out(first.size());
  for (Eigen::Index i = 0; i < out.size(); ++i)
    out[i] = static_cast<double>(end[static_cast<std::size_t>(i)]);
  return out;
}

template <Retraction kind>
std::vector<GroupScene> all_scenes() {
  return {heavy_top(rotations<kind>()), driven_top(rotations<kind>()), suslov(rotations<kind>()),
          chaplygin_ball<kind>(),       top_with_rows<kind>(),         sleigh<kind>(),
          body_on_spring<kind>(),       pendulum_on_sphere<kind>()};
}

template std::vector<GroupScene> all_scenes<Retraction::exponential>();
template std::vector<GroupScene> all_scenes<Retraction::cayley>();
template GroupScene top_with_rows<Retraction::exponential>();
template GroupScene body_on_spring<Retraction::exponential>();

}  // namespace diracstep::group_scenes
