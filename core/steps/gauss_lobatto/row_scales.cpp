#include <algorithm>
#include <diracstep/core/steps/gauss_lobatto/row_scales.hpp>
#include <diracstep/core/steps/length_of_rows.hpp>

namespace diracstep {

StageRowScales::StageRowScales(int stages, const Scene& scene)
    : s_(stages),
      n_(scene.dimension()),
      m_(scene.rows()),
      quadratic_(scene.lagrangian->structure().quadratic && !scene.force),
      length_(length_of_rows(scene)),
      tolerances_(scene.tolerances) {
  for (Vector* column : {&q_, &v_, &largest_q_, &largest_v_, &momenta_, &largest_momenta_})
    column->setZero(n_);
  for (Vector* column : {&rows_, &largest_rows_}) column->setZero(m_);
  scales_ = RowScales(Eigen::Index{s_} * (n_ + m_));
}

const double* StageRowScales::beside_all_terms(const Point& point, ConstVectorRef f, double level,
                                               std::span<const ResidualBlock> blocks, double part) {
  const double h = std::abs(point.at.step.size);
  q_ = point.at.lobatto.col(0);
  v_ = point.x.head(n_);
  const auto set_largest = [&](bool none, double length) {
    RowScales::set_largest(largest_q_, none ? 0.0 : std::max(max_norm(q_), length), tolerances_, level);
    RowScales::set_largest(largest_v_, none ? 0.0 : max_norm(v_), tolerances_, h * level);
  };
  set_largest(quadratic_, 0.0);
  point.momentum.prepare_sizes(point.at, point.x);
  momenta_ = point.p0.cwiseAbs();
  for (int i = 0; i < s_; ++i)
    momenta_ += point.momentum.momenta().col(i).cwiseAbs() + h * point.momentum.forces().col(i).cwiseAbs();
  largest_momenta_.setZero();
  point.momentum.add_sizes(h, q_, v_, momenta_);
  point.momentum.add_sizes(h, largest_q_, largest_v_, largest_momenta_);
  for (StageRows& rows : point.rows) rows.add_impulse_sizes(point.at, point.x, q_, momenta_);
  // What a row cancels is among its terms: the velocity that the momenta would have without it.
  point.momentum.pattern().for_each([&](Eigen::Index e, int r, int c) {
    const double mass = std::abs(point.momentum.mass(0)[e]);
    if (r == c && mass > 0.0) v_[c] = std::max(std::abs(v_[c]), momenta_[c] / mass);
  });
  for (StageRows& rows : point.rows) {
    set_largest(rows.rows().constant(), part_of_length * length_);
    rows.size_terms(h, largest_q_, largest_v_, largest_rows_);
    rows.size_terms(h, q_, v_, rows_);
  }
  for (Vector* sizes : {&momenta_, &largest_momenta_, &rows_, &largest_rows_}) *sizes *= part;
  for (int i = 0; i < s_; ++i) scales_.set(n_ * i, momenta_, largest_momenta_, blocks[0].scale);
  for (int j = 0; j < s_ && m_ > 0; ++j) scales_.set(n_ * s_ + m_ * j, rows_, largest_rows_, blocks[1].scale);
  return scales_.unsolved(f, level);
}

}  // namespace diracstep
