#include <diracstep/core/steps/gauss_lobatto/compensated_sums.hpp>

namespace diracstep {

CompensatedSums::CompensatedSums(int stages, int dimension)
    : table(extended_gauss_lobatto_tableau(stages)), sum_(ExtendedVector::Zero(dimension)) {
  for (ExtendedVector* column : {&start_.q, &start_.p}) column->setZero(dimension);
}

void CompensatedSums::begin(const Remainder& rest) {
  if (rest.q.size() == sum_.size()) {
    start_ = rest;
    return;
  }
  start_.q.setZero();
  start_.p.setZero();
}

void CompensatedSums::momentum_row(int i, double h, ConstVectorRef lv, const Vector& p0, ConstColumnsRef lq,
                                   ConstColumnsRef impulses, VectorRef row) {
  sum_ = start_.p;
  for (Eigen::Index j = 0; j < lq.cols(); ++j) {
    const long double factor = h * table.a_hat(i, j), share = table.e(i, j);
    for (Eigen::Index r = 0; r < lq.rows(); ++r) sum_[r] += factor * lq(r, j) + share * impulses(r, j);
  }
  for (Eigen::Index r = 0; r < p0.size(); ++r)
    row[r] = static_cast<double>(static_cast<long double>(lv[r]) - p0[r] - sum_[r]);
}

void CompensatedSums::end(double h, ConstVectorRef q0, const Vector& p0, ConstColumnsRef v,
                          ConstColumnsRef lq, ConstColumnsRef impulses, StepEnd& end) {
  add_stages(h, table.b, v);
  sum_ += start_.q;
  round(q0, sum_, end.q, end.rest.q);
  sum_ = start_.p;
  for (Eigen::Index j = 0; j < lq.cols(); ++j) {
    const long double factor = h * table.b[j], share = table.lobatto_b[j];
    for (Eigen::Index r = 0; r < lq.rows(); ++r) sum_[r] += factor * lq(r, j) + share * impulses(r, j);
  }
  round(p0, sum_, end.p, end.rest.p);
}

void CompensatedSums::round(ConstVectorRef from, const ExtendedVector& change, Vector& to,
                            ExtendedVector& remainder) {
  to.resize(from.size());
  remainder.resize(from.size());
  for (Eigen::Index r = 0; r < from.size(); ++r) {
    const long double exact = from[r] + change[r];
    to[r] = static_cast<double>(exact);
    remainder[r] = change[r] - (static_cast<long double>(to[r]) - from[r]);
  }
}

}  // namespace diracstep
