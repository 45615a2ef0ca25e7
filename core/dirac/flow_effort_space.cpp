#include <Eigen/QR>
#include <diracstep/core/dirac/flow_effort_space.hpp>
#include <diracstep/core/dirac/orthonormal_bases.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>

namespace diracstep {

OrthonormalBases orthonormal_bases(Columns columns) {
  const Eigen::Index n = columns.rows();
  if (columns.cols() == 0) return {Columns(n, 0), Columns::Identity(n, n)};
  const double negligible = 1e-10 * columns.colwise().norm().maxCoeff();
  for (Eigen::Index j = 0; j < columns.cols(); ++j) {
    const double size = columns.col(j).norm();
    columns.col(j) *= size > negligible ? 1.0 / size : 0.0;
  }
  Eigen::ColPivHouseholderQR<Columns> qr(columns);
  qr.setThreshold(1e-10);
  const Columns q = qr.householderQ() * Columns::Identity(n, n);
  return {q.leftCols(qr.rank()), q.rightCols(n - qr.rank())};
}

namespace {

void require_same_size(const char* what, const Columns& a, const Columns& b) {
  require_size(std::string(what) + ": rows", b.rows(), a.rows());
  require_size(std::string(what) + ": columns", b.cols(), a.cols());
}

Columns stacked(const Columns& above, const Columns& below) {
  Columns both(above.rows() + below.rows(), above.cols());
  both.topRows(above.rows()) = above;
  both.bottomRows(below.rows()) = below;
  return both;
}

/// a in the upper left corner, b in the lower right.
Columns diagonal_blocks(const Columns& a, const Columns& b) {
  Columns both = Columns::Zero(a.rows() + b.rows(), a.cols() + b.cols());
  both.topLeftCorner(a.rows(), a.cols()) = a;
  both.bottomRightCorner(b.rows(), b.cols()) = b;
  return both;
}

/// Largest entry of a bᵀ + b aᵀ.
double symmetric_product(const Columns& a, const Columns& b) {
  const Columns product = a * b.transpose();
  return max_norm(product + product.transpose());
}

}  // namespace

double pairing(const Vector& f, const Vector& e, const Vector& f_other, const Vector& e_other) {
  return e.dot(f_other) + e_other.dot(f);
}

FlowEffortSpace FlowEffortSpace::kernel_of(const Columns& flows, const Columns& efforts) {
  require_same_size("the kernel form of a space of flows and efforts", flows, efforts);
  const OrthonormalBases bases = orthonormal_bases(stacked(flows.transpose(), efforts.transpose()));
  return {bases.span.transpose(), bases.complement};
}

FlowEffortSpace FlowEffortSpace::image_of(const Columns& flows, const Columns& efforts) {
  require_same_size("the image form of a space of flows and efforts", flows, efforts);
  const OrthonormalBases bases = orthonormal_bases(stacked(flows, efforts));
  return {bases.complement.transpose(), bases.span};
}

double FlowEffortSpace::outside(const Vector& f, const Vector& e) const {
  require_size("flows", f.size(), size());
  require_size("efforts", e.size(), size());
  return max_norm(kernel_.leftCols(size()) * f + kernel_.rightCols(size()) * e);
}

double FlowEffortSpace::outside(const FlowEffortSpace& other) const {
  require_size("flows", other.size(), size());
  return max_norm(kernel_ * other.image_);
}

FlowEffortSpace FlowEffortSpace::orthogonal() const {
  return kernel_of(image_efforts().transpose(), image_flows().transpose());
}

double FlowEffortSpace::isotropy_defect() const {
  return symmetric_product(image_flows().transpose(), image_efforts().transpose());
}

double FlowEffortSpace::maximality_defect() const {
  return symmetric_product(kernel_flows(), kernel_efforts());
}

FlowEffortSpace distribution_structure(const Columns& one_forms) {
  const OrthonormalBases bases = orthonormal_bases(one_forms.transpose());
  return FlowEffortSpace::image_of(diagonal_blocks(bases.complement, Columns(0, bases.span.cols())),
                                   diagonal_blocks(Columns(0, bases.complement.cols()), bases.span));
}

FlowEffortSpace direct_sum(const FlowEffortSpace& a, const FlowEffortSpace& b) {
  return FlowEffortSpace::image_of(diagonal_blocks(a.image_flows(), b.image_flows()),
                                   diagonal_blocks(a.image_efforts(), b.image_efforts()));
}

FlowEffortSpace composition(const FlowEffortSpace& a, const FlowEffortSpace& b, int ports) {
  if (ports < 0 || ports > a.size() || ports > b.size())
    throw Misuse("a composition over " + std::to_string(ports) + " ports of spaces with " +
                 std::to_string(a.size()) + " and " + std::to_string(b.size()) + " flows");
  const Columns xa = a.image_flows(), ya = a.image_efforts(), xb = b.image_flows(), yb = b.image_efforts();
  const int of_a = a.size() - ports, of_b = b.size() - ports;
  // Coefficients (z_A, z_B) of the images whose flows at the ports cancel and whose efforts agree there.
  Columns shared(2 * ports, xa.cols() + xb.cols());
  shared.leftCols(xa.cols()) = stacked(xa.bottomRows(ports), ya.bottomRows(ports));
  shared.rightCols(xb.cols()) = stacked(xb.topRows(ports), -yb.topRows(ports));
  const Columns allowed = orthonormal_bases(shared.transpose()).complement;
  return FlowEffortSpace::image_of(diagonal_blocks(xa.topRows(of_a), xb.bottomRows(of_b)) * allowed,
                                   diagonal_blocks(ya.topRows(of_a), yb.bottomRows(of_b)) * allowed);
}

}  // namespace diracstep
