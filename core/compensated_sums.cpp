#include <diracstep/core/compensated_sums.hpp>

namespace diracstep {

CompensatedSums::CompensatedSums(int stages, int dimension)
    : table(extended_gauss_lobatto_tableau(stages)), sum_(Extended::Zero(dimension)) {
  for (Extended* column : {&start_.q, &start_.p, &end_.q, &end_.p}) column->setZero(dimension);
  end_q_.setZero(dimension);
  end_p_ = end_q_;
}

void CompensatedSums::forget() {
  for (Extended* column : {&start_.q, &start_.p, &end_.q, &end_.p}) column->setZero();
}

void CompensatedSums::begin(const Vector& q0, const Vector& p0, const Vector& last_q0,
                            const Vector& last_p0) {
  if (q0 == end_q_ && p0 == end_p_) {
    start_.q = end_.q;
    start_.p = end_.p;
  } else if (!(q0 == last_q0 && p0 == last_p0)) {  // else the same step once more
    start_.q.setZero();
    start_.p.setZero();
  }
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

void CompensatedSums::end(double h, const Vector& q0, const Vector& p0, ConstColumnsRef v, ConstColumnsRef lq,
                          ConstColumnsRef impulses, Vector& q1, Vector& p1) {
  add_stages(h, table.b, v);
  sum_ += start_.q;
  round(q0, sum_, q1, end_.q);
  sum_ = start_.p;
  for (Eigen::Index j = 0; j < lq.cols(); ++j) {
    const long double factor = h * table.b[j], share = table.lobatto_b[j];
    for (Eigen::Index r = 0; r < lq.rows(); ++r) sum_[r] += factor * lq(r, j) + share * impulses(r, j);
  }
  round(p0, sum_, p1, end_.p);
  end_q_ = q1;
  end_p_ = p1;
}

void CompensatedSums::round(const Vector& from, const Extended& change, Vector& to, Extended& remainder) {
  to.resize(from.size());
  for (Eigen::Index r = 0; r < from.size(); ++r) {
    const long double exact = from[r] + change[r];
    to[r] = static_cast<double>(exact);
    remainder[r] = change[r] - (static_cast<long double>(to[r]) - from[r]);
  }
}

}  // namespace diracstep
