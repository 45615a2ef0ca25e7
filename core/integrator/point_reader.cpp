#include <diracstep/core/integrator/point_reader.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/lu.hpp>
#include <diracstep/core/system/kernel_motions.hpp>
#include <diracstep/core/system/multiplier_rows.hpp>
#include <utility>

namespace diracstep {

struct PointReader::Elimination {
  explicit Elimination(int size)
      : matrix(Columns::Zero(size, size)), factors(size), right(Vector::Zero(size)), solution(right) {}
  Columns matrix;
  Eigen::PartialPivLU<Columns> factors;
  Vector right, solution;
};

PointReader::PointReader(std::shared_ptr<const Scene> scene, SolverFactory solvers, bool full)
    : scene_(std::move(scene)), solvers_(std::move(solvers)), full_(full) {
  if (scene_->by_hamiltonian()) {
    hamiltonian_velocity_ = std::make_unique<HamiltonianVelocityProblem>(*scene_, full);
    velocity_solver_ = solvers_(*hamiltonian_velocity_);
  } else if (const FirstOrderMotions motions = first_order_motions(*scene_);
             motions.exist() && !by_two_form_alone(*scene_, motions)) {
    first_order_velocity_ = velocity_problem(*scene_, motions);
    velocity_solver_ = solvers_(*first_order_velocity_);
  } else if (motions.exist()) {
    phase_space_velocity_ = std::make_unique<PhaseSpaceVelocityProblem>(*scene_, full);
    velocity_solver_ = solvers_(*phase_space_velocity_);
  } else {
    velocity_ = std::make_unique<VelocityProblem>(*scene_, full);
    velocity_solver_ = solvers_(*velocity_);
  }
  unknowns_.setZero(scene_->dimension() + scene_->rows());
  lq_.setZero(scene_->dimension());
}

PointReader::~PointReader() = default;

/// A run that is not read in between does without.
AccelerationProblem& PointReader::acceleration_problem() {
  if (!acceleration_) acceleration_ = std::make_unique<AccelerationProblem>(*scene_, full_);
  return *acceleration_;
}

/// Whether v follows from p without a system: L_v = L_v(q, 0) + M v with M constant and diagonal, and no
/// rows.
bool PointReader::constant_diagonal_mass(double t, ConstVectorRef q) {
  const Lagrangian& l = *scene_->lagrangian;
  const PhaseStructure& structure = l.structure();
  if (scene_->rows() > 0 || !structure.y_hessian_constant || !structure.y_hessian_diagonal) return false;
  if (mass_examined_) return mass_.size() > 0;
  mass_examined_ = true;
  const Vector rest = Vector::Zero(scene_->dimension());
  Vector qq(l.pattern().nonzeros()), qv = qq, vv = qq, diagonal = rest;
  l.hessian(t, q, rest, qq, qv, vv);
  Eigen::Index value = 0;
  for (const auto& [row, column] : l.pattern().entries()) {
    if (row == column) diagonal[row] = vv[value];
    ++value;
  }
  if (diagonal.allFinite() && (diagonal.array() != 0.0).all()) mass_ = diagonal;
  return mass_.size() > 0;
}

SolveReport PointReader::velocity(double t, ConstVectorRef q, ConstVectorRef p, Vector& v) {
  if (hamiltonian_velocity_) return velocity_by_hamiltonian(t, q, p, v);
  if (first_order_velocity_) return velocity_of_first_order(t, q, p, v);
  if (!phase_space_velocity_ && constant_diagonal_mass(t, q)) {
    v.setZero(p.size());
    scene_->lagrangian->gradient(t, q, v, lq_, unknowns_);
    v = (p - unknowns_).cwiseQuotient(mass_);
    SolveReport report;
    if (!v.allFinite()) report.status = SolveStatus::not_finite;
    return report;
  }
  velocity_solver_->reset();
  if (phase_space_velocity_) {
    phase_space_velocity_->begin(t, q);
    return velocity_solver_->solve(v);
  }
  const Eigen::Index n = scene_->dimension();
  velocity_->begin(t, q, p, v);
  unknowns_.head(n) = v;
  unknowns_.tail(unknowns_.size() - n).setZero();
  const SolveReport report = velocity_solver_->solve(unknowns_);
  velocity_solver_->reset();  // factors of a large scene take much memory
  if (report.ok()) v = unknowns_.head(n);
  return report;
}

bool PointReader::velocity_by_forces() const {
  return dynamic_cast<const ByForceVelocityProblem*>(first_order_velocity_.get()) != nullptr;
}

SolveReport PointReader::velocity_of_first_order(double t, ConstVectorRef q, ConstVectorRef p, Vector& v) {
  const Eigen::Index n = scene_->dimension();
  velocity_solver_->reset();
  first_order_velocity_->begin(t, q, p);
  unknowns_.head(n) = v;
  unknowns_.tail(scene_->rows()).setZero();
  SolveReport report = velocity_solver_->solve(unknowns_);
  velocity_solver_->reset();
  auto* by_force = dynamic_cast<ByForceVelocityProblem*>(first_order_velocity_.get());
  if (!report.ok() && by_force != nullptr) {  // as where a switch has opened: far from where diodes were
    unknowns_.head(n) = v;
    unknowns_.tail(scene_->rows()).setZero();
    if (by_force->solve_from_afar(unknowns_).empty()) report.status = SolveStatus::ok;
  }
  if (!report.ok()) return report;
  v = unknowns_.head(n);
  if (by_force != nullptr) unknowns_.tail(scene_->rows()) = by_force->forces(v);
  return report;
}

/// Whether the velocity of the point is that of a solved stage.  Then unknowns_ holds the forces of rows.
bool PointReader::keep_velocity(double t, const State& at) {
  auto* by_force = dynamic_cast<ByForceVelocityProblem*>(first_order_velocity_.get());
  if (by_force == nullptr) return false;
  by_force->begin(t, at.q, at.p);
  if (!by_force->holds(at.v)) return false;
  unknowns_.tail(scene_->rows()) = by_force->forces(at.v);
  return true;
}

void PointReader::determine(Start& start) {
  if (!first_order_velocity_) return;
  Vector p(start.v.size());
  scene_->lagrangian->gradient(start.time, start.q, start.v, lq_, p);
  const SolveReport report = velocity(start.time, start.q, p, start.v);
  if (!report.ok())
    throw Misuse("scene '" + scene_->name +
                 "': the velocities of its motions of first order at the start: " + describe(report.status));
}

/// Without rows every momentum is that of its velocity ∂H/∂p.
SolveReport PointReader::velocity_by_hamiltonian(double t, ConstVectorRef q, ConstVectorRef p, Vector& v) {
  SolveReport report;
  if (scene_->rows() == 0) {
    v.setZero(p.size());
    scene_->hamiltonian->gradient(t, q, p, lq_, v);
    projected_ = p;
    if (!v.allFinite()) report.status = SolveStatus::not_finite;
    return report;
  }
  const Eigen::Index n = scene_->dimension();
  velocity_solver_->reset();
  hamiltonian_velocity_->begin(t, q, p, v);
  unknowns_.head(n) = v;
  unknowns_.tail(scene_->rows()).setZero();
  report = velocity_solver_->solve(unknowns_);
  velocity_solver_->reset();
  if (!report.ok()) return report;
  v = unknowns_.head(n);
  hamiltonian_velocity_->project(unknowns_, projected_);
  return report;
}

namespace {

/// a with M a = F, where M is diagonal: the residual at a = 0 is −F.
SolveReport divide_by_masses(AccelerationProblem& problem, const Vector& mass, VectorRef residual,
                             VectorRef a) {
  a.setZero();
  problem.residual(a, residual);
  a = -residual.cwiseQuotient(mass);
  SolveReport report;
  if (!a.allFinite()) report.status = SolveStatus::not_finite;
  return report;
}

}  // namespace

SolveReport PointReader::acceleration(double t, ConstVectorRef q, ConstVectorRef v, Vector& a,
                                      Vector& lambda) {
  if (phase_space_velocity_ || first_order_velocity_) {
    a.resize(0);
    lambda.resize(0);
    return {};
  }
  acceleration_problem().begin(t, q, v);
  if (constant_diagonal_mass(t, q)) {
    a.resize(mass_.size());
    lambda.resize(0);
    return divide_by_masses(*acceleration_, mass_, lq_, a);
  }
  return solve_acceleration(*acceleration_, acceleration_solver_, a, lambda);
}

SolveReport PointReader::acceleration(double t, ConstVectorRef q, ConstVectorRef v, ConstVectorRef p,
                                      Vector& a, Vector& lambda) {
  if (first_order_velocity_) {  // without accelerations, but not without forces of rows
    a.resize(0);
    Vector again = v;
    const SolveReport report = velocity(t, q, p, again);
    lambda = unknowns_.tail(scene_->rows());
    return report;
  }
  if (!hamiltonian_velocity_) return acceleration(t, q, v, a, lambda);
  if (!hamiltonian_acceleration_)
    hamiltonian_acceleration_ = std::make_unique<HamiltonianAccelerationProblem>(*scene_, full_);
  hamiltonian_acceleration_->begin(t, q, p, v);
  return solve_acceleration(*hamiltonian_acceleration_, hamiltonian_acceleration_solver_, a, lambda);
}

SolveReport PointReader::solve_acceleration(NonlinearProblem& problem,
                                            std::unique_ptr<NonlinearSolver>& solver, Vector& a,
                                            Vector& lambda) {
  if (!solver) solver = solvers_(problem);
  unknowns_.setZero();
  solver->reset();
  const SolveReport report = solver->solve(unknowns_);
  a = unknowns_.head(scene_->dimension());
  lambda = unknowns_.tail(scene_->rows());
  return report;
}

SolveReport PointReader::acceleration_by_elimination(double t, ConstVectorRef q, ConstVectorRef v,
                                                     VectorRef a) {
  AccelerationProblem& problem = acceleration_problem();
  problem.begin(t, q, v);
  if (constant_diagonal_mass(t, q)) return divide_by_masses(problem, mass_, lq_, a);
  if (!elimination_) elimination_ = std::make_unique<Elimination>(problem.size());
  Elimination& system = *elimination_;
  system.solution.setZero();
  problem.residual(system.solution, system.right);
  problem.jacobian(system.solution, system.matrix.reshaped());
  system.factors.compute(system.matrix);
  system.right = -system.right;
  solve_into(system.factors, system.right, system.solution);
  SolveReport report;
  if (!system.solution.allFinite()) report.status = SolveStatus::singular_jacobian;
  a = system.solution.head(a.size());
  return report;
}

SolveReport PointReader::read(double t, const State& at, Momentum momentum, Sample& sample) {
  sample.v = at.v;
  SolveReport report;
  if (!keep_velocity(t, at)) report = velocity(t, at.q, at.p, sample.v);
  if (scene_->rows() == 0)
    sample.lambda.resize(0);
  else if (first_order_velocity_)
    sample.lambda = unknowns_.tail(scene_->rows());
  else if (report.ok())
    report = acceleration(t, at.q, sample.v, projected_, a_, sample.lambda);
  if (!report.ok()) return report;
  sample.time = t;
  sample.q = at.q;
  if (scene_->rows() > 0) show_multipliers(*scene_, sample.lambda, sample.q);
  sample.p = at.p;
  sample.impulse.resize(0);
  if (hamiltonian_velocity_) {
    sample.energy = scene_->hamiltonian->value(t, at.q, projected_);
    if (momentum == Momentum::projected) sample.p = projected_;
    return report;
  }
  sample.energy = scene_->energy(t, at.q, sample.v);
  if (momentum == Momentum::projected) scene_->lagrangian->gradient(t, at.q, sample.v, lq_, sample.p);
  return report;
}

}  // namespace diracstep
