#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/system/legendre_transform.hpp>
#include <diracstep/core/system/rows_along_motions.hpp>
#include <diracstep/core/system/scene.hpp>
#include <sstream>
#include <utility>

namespace diracstep {

namespace {

constexpr double start_tolerance = 1e-10;

void require_finite(const Scene& scene, const char* what, const Vector& column) {
  for (int i = 0; i < column.size(); ++i)
    if (!std::isfinite(column[i])) {
      std::ostringstream message;
      const bool named = column.size() == scene.dimension();
      message << "scene '" << scene.name << "': the start has " << what << "_"
              << (named ? scene.coordinates[static_cast<std::size_t>(i)] : std::to_string(i)) << " = "
              << column[i] << "; a finite number is needed";
      throw Misuse(message.str());
    }
}

[[noreturn]] void throw_off_row(const Scene& scene, int row, InconsistentStart::Of of, double residual,
                                double terms) {
  const bool of_position = of == InconsistentStart::Of::position;
  std::ostringstream reason;
  reason << "violates " << row_label(scene.constraints, row) << ": "
         << (of_position ? "φ(q)" : "the velocity is off the distribution, A v + b") << " = " << residual
         << ", allowed " << start_tolerance * terms;
  throw InconsistentStart(scene.name, reason.str(), of);
}

/// Whether each velocity changes the numbers stored: none changes a quaternion of zeros.
bool can_move(const Space& space, const Vector& q) {
  return (space.tangent_basis(q).colwise().norm().array() > 0.0).all();
}

/// A start on the space, to within what a text with a few digits less than a double has.
void require_on_space(const Scene& scene, const Vector& q) {
  if (!scene.space) return;
  const double off = max_norm(scene.space->normalised(q) - q);
  const bool moves = can_move(*scene.space, q);
  if (off <= start_tolerance && moves) return;
  std::ostringstream message;
  message << "scene '" << scene.name << "': the start q is not on " << scene.space->name();
  if (moves)
    message << ", by " << off
            << ": quaternions and (cos, sin) have length 1; Space::normalised() makes them so";
  else
    message << ": quaternions and (cos, sin) have length 1, one here has none";
  throw Misuse(message.str());
}

/// How large the numbers of a place count, along the tangent space.
Vector sizes_of_place(const Scene& scene, const Vector& q) {
  const double largest = max_norm(q);
  if (scene.space) return Vector::Constant(scene.dimension(), largest);
  return q.unaryExpr([largest](double x) { return size_beside(x, largest); });
}

/// The same of a velocity, of which none is no motion.
Vector sizes_of_velocity(const Vector& v) {
  const double largest = max_norm(v);
  if (!(largest > 0.0)) return Vector::Zero(v.size());
  return v.unaryExpr([largest](double x) { return size_beside(x, largest); });
}

/// terms += |A| sizes, and what the round-off of a number of size 1 is allowed.
void add_terms(const ConstraintRows& rows, const Vector& a, const Vector& sizes, Vector& terms) {
  constexpr double round_off = 1e-15 / start_tolerance;
  const Vector size = a.cwiseAbs(), all = sizes.array() + round_off;
  rows.pattern().multiply_add(size.data(), all.data(), terms.data());
}

}  // namespace

std::vector<std::string> Scene::row_names() const {
  std::vector<std::string> names;
  for (const auto& block : constraints)
    names.insert(names.end(), block->names().begin(), block->names().end());
  return names;
}

int Scene::storage_size() const { return space ? space->storage_size() : dimension(); }

void Scene::add_turning(ConstVectorRef v, ConstVectorRef momentum, VectorRef rate) const {
  if (!space) return;
  const int d = space->group_dimension();
  Vector velocity(d), covector(d), turned(dimension());
  Columns coadjoint(d, d);
  space->embed(v, velocity);
  space->embed(momentum, covector);
  space->coadjoint(covector, coadjoint);
  space->restrict(coadjoint * velocity, turned);
  rate += turned;
}

const PhaseFunction& Scene::stepped_function() const {
  if (by_hamiltonian()) return *hamiltonian;
  return *lagrangian;
}

double Scene::energy(const Start& at) const {
  return by_hamiltonian() ? hamiltonian->value(at.time, at.q, at.p) : energy(at.time, at.q, at.v);
}

void Scene::force_and_momentum(double t, ConstVectorRef q, ConstVectorRef v, ConstVectorRef p, VectorRef lq,
                               VectorRef momentum) const {
  if (!by_hamiltonian()) return lagrangian->gradient(t, q, v, lq, momentum);
  hamiltonian->gradient(t, q, p, lq, momentum);
  lq = -lq;
  momentum = p;
}

double Scene::energy(double t, ConstVectorRef q, ConstVectorRef v) const {
  Vector lq(v.size()), lv(v.size());
  lagrangian->gradient(t, q, v, lq, lv);
  return v.dot(lv) - lagrangian->value(t, q, v);
}

void require_well_formed(const Scene& scene) {
  const std::string prefix = "scene '" + scene.name + "': ";
  if (scene.dimension() == 0) throw Misuse(prefix + "it has no coordinates");
  if (!scene.lagrangian && !scene.hamiltonian)
    throw Misuse(prefix + "it has neither a Lagrangian nor a Hamiltonian");
  if (scene.space) {
    require_size(prefix + "the coordinates on " + scene.space->name(), scene.dimension(),
                 scene.space->dimension());
    if (scene.hamiltonian || !scene.lagrangian)
      throw Misuse(prefix + "on " + scene.space->name() +
                   " a scene is given by a Lagrangian, and by that alone");
  }
  if (scene.lagrangian)
    require_size(prefix + "the Lagrangian", scene.lagrangian->dimension(), scene.dimension());
  if (scene.hamiltonian)
    require_size(prefix + "the Hamiltonian", scene.hamiltonian->dimension(), scene.dimension());
  if (scene.force) require_size(prefix + "the force", scene.force->dimension(), scene.dimension());
  for (const auto& block : scene.constraints) {
    if (!block) throw Misuse(prefix + "scene.constraints holds a null pointer");
    require_size(prefix + "a constraint row", block->dimension(), scene.dimension());
  }
  if (scene.tolerances.size() == 0) return;
  require_size(prefix + "scene.tolerances", scene.tolerances.size(), scene.dimension());
  for (const double tolerance : scene.tolerances)
    if (!(tolerance >= 0.0 && std::isfinite(tolerance)))
      throw Misuse(prefix + "a tolerance of a coordinate is a finite number of 0 or more");
}

namespace {

/// (p, v = ∂H/∂p) of a scene given by a Hamiltonian alone.
Start completed_by_hamiltonian(const Scene& scene, Start start) {
  const std::string of_scene = "scene '" + scene.name + "': ";
  Vector unused(scene.dimension());
  if (start.p.size() == 0) {
    if (start.v.size() == 0) return start;  // told by who needs a start
    require_size(of_scene + "the start q", start.q.size(), scene.storage_size());
    require_size(of_scene + "the start v", start.v.size(), scene.dimension());
    const auto l = scene.lagrangian ? scene.lagrangian
                                    : lagrangian_from(scene.hamiltonian, start.time, start.q, start.v);
    start.p.setZero(scene.dimension());
    l->gradient(start.time, start.q, start.v, unused, start.p);
    return start;
  }
  require_size(of_scene + "the start q", start.q.size(), scene.storage_size());
  require_size(of_scene + "the start p", start.p.size(), scene.dimension());
  start.v.setZero(scene.dimension());
  scene.hamiltonian->gradient(start.time, start.q, start.p, unused, start.v);
  return start;
}

}  // namespace

Start completed_start(const Scene& scene, Start start) {
  if (scene.by_hamiltonian()) return completed_by_hamiltonian(scene, std::move(start));
  if (start.v.size() > 0) return start;
  if (scene.lagrangian && scene.lagrangian->structure().y_hessian_zero) {
    start.v = Vector::Zero(scene.dimension());
    return start;
  }
  if (start.p.size() == 0) return start;
  const std::string prefix = "scene '" + scene.name + "': ";
  require_size(prefix + "the start q", start.q.size(), scene.storage_size());
  require_size(prefix + "the start p", start.p.size(), scene.dimension());
  start.v.setZero(scene.dimension());  // where the Lagrangian is tested for a Hamiltonian
  const auto hamiltonian = scene.hamiltonian
                               ? scene.hamiltonian
                               : hamiltonian_from(scene.lagrangian, start.time, start.q, start.v);
  Vector hq(scene.dimension());
  hamiltonian->gradient(start.time, start.q, start.p, hq, start.v);
  return start;
}

std::shared_ptr<const Scene> completed(std::shared_ptr<const Scene> scene) {
  if (!scene) throw Misuse("no scene was given");
  require_well_formed(*scene);
  const Start start = completed_start(*scene, scene->start);
  const bool complete = start.v.size() == scene->start.v.size() && start.p.size() == scene->start.p.size();
  if (scene->lagrangian && complete) return scene;
  auto copy = std::make_shared<Scene>(*scene);
  copy->start = start;
  if (scene->lagrangian) return copy;
  const std::string prefix = "scene '" + scene->name + "': ";
  require_size(prefix + "the start q", start.q.size(), scene->storage_size());
  require_size(prefix + "the start p", start.p.size(), scene->dimension());
  copy->lagrangian_derived =
      directions_linear_in_p(*scene->hamiltonian, start.time, start.q, start.p).cols() == 0;
  if (copy->lagrangian_derived)
    copy->lagrangian = lagrangian_from(scene->hamiltonian, start.time, start.q, start.p);
  return copy;
}

std::shared_ptr<const Lagrangian> lagrangian_of(const Scene& scene) {
  if (scene.lagrangian) return scene.lagrangian;
  const Start start = completed_start(scene, scene.start);
  const Columns directions = directions_linear_in_p(*scene.hamiltonian, start.time, start.q, start.p);
  if (directions.cols() == 0) return lagrangian_from(scene.hamiltonian, start.time, start.q, start.p);
  std::string along;
  for (Eigen::Index k = 0; k < directions.cols(); ++k)
    along += (k == 0 ? "'" : ", '") + motion_along(scene, directions.col(k)) + "'";
  throw Misuse("scene '" + scene.name +
               "': the Hamiltonian is degenerate: at the start ∂²H/∂p² is singular " +
               "along the momenta of " + along +
               ", so it has no Lagrangian, which this needs; typeN/gl:S, type1/midpoint, type2/euler and "
               "type3/euler step it as it is");
}

std::shared_ptr<const Scene> with_lagrangian(const Scene& scene) {
  auto complete = completed(std::make_shared<const Scene>(scene));
  if (!complete->by_hamiltonian()) return complete;
  auto copy = std::make_shared<Scene>(*complete);
  copy->lagrangian = lagrangian_of(*complete);
  copy->lagrangian_derived = false;
  return copy;
}

std::shared_ptr<const Hamiltonian> hamiltonian_of(const Scene& scene) {
  if (scene.hamiltonian) return scene.hamiltonian;
  return hamiltonian_from(scene.lagrangian, scene.start.time, scene.start.q, scene.start.v);
}

void require_consistent(const Scene& scene, const Start& given) {
  const std::string prefix = "scene '" + scene.name + "': ";
  const Start start = completed_start(scene, given);
  require_size(prefix + "the start q", start.q.size(), scene.storage_size());
  require_size(prefix + "the start v", start.v.size(), scene.dimension());
  require_finite(scene, "q", start.q);
  require_finite(scene, "v", start.v);
  if (!std::isfinite(start.time)) throw Misuse(prefix + "the start time is not finite");
  require_on_space(scene, start.q);
  const Vector position = sizes_of_place(scene, start.q), velocity = sizes_of_velocity(start.v);
  const double since = std::abs(start.time);
  int first = 0;
  for (const auto& block : scene.constraints) {
    const int m = block->rows();
    Vector a(block->pattern().nonzeros()), b(m), residual(m), terms(m), phi(m);
    block->coefficients(start.time, start.q, a, b);
    if (block->holonomic()) {
      block->position(start.time, start.q, phi);
      terms = since * b.cwiseAbs();
      add_terms(*block, a, position, terms);
      for (int r = 0; r < m; ++r)
        if (!(std::abs(phi[r]) <= start_tolerance * terms[r]))
          throw_off_row(scene, first + r, InconsistentStart::Of::position, phi[r], terms[r]);
    }
    residual = b;
    block->pattern().multiply_add(a.data(), start.v.data(), residual.data());
    terms = b.cwiseAbs();
    add_terms(*block, a, velocity, terms);
    // A and b may be differences of large terms: what they lose by q and t as they are known.
    Vector by_q(a.size()), by_t(m);
    block->derivative(start.time, start.q, start.v, 1.0, by_q);
    block->time_derivative(start.time, start.q, start.v, by_t);
    add_terms(*block, by_q, position, terms);
    terms += since * by_t.cwiseAbs();
    for (int r = 0; r < m; ++r)
      if (!(std::abs(residual[r]) <= start_tolerance * terms[r]))
        throw_off_row(scene, first + r, InconsistentStart::Of::velocity, residual[r], terms[r]);
    first += m;
  }
}

}  // namespace diracstep
