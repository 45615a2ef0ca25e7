#include <diracstep/core/steps/gauss_lobatto/compensated_sums.hpp>
#include <limits>

namespace diracstep {

namespace {

/// So many doubles hold a long double: two with the 64 bits of x87, three with 113.
constexpr int doubles_of_extended = (std::numeric_limits<long double>::digits + 52) / 53;

}  // namespace

CompensatedSums::CompensatedSums(int stages, int dimension)
    : table(extended_gauss_lobatto_tableau(stages)), sum_(Extended::Zero(dimension)) {
  for (Extended* column : remainders()) column->setZero(dimension);
  for (Vector* column : points()) column->setZero(dimension);
}

void CompensatedSums::forget() {
  for (Extended* column : remainders()) column->setZero();
}

void CompensatedSums::keep() {
  kept_ = end_;
  kept_q_ = end_q_;
  kept_p_ = end_p_;
}

void CompensatedSums::save(Snapshot& to) const {
  for (const Extended* column : {&start_.q, &start_.p, &end_.q, &end_.p, &kept_.q, &kept_.p})
    for (long double rest : *column)
      for (int k = 0; k < doubles_of_extended; ++k) {
        const auto leading = static_cast<double>(rest);
        to.put(leading);
        rest -= leading;
      }
  for (const Vector* column : {&end_q_, &end_p_, &kept_q_, &kept_p_}) to.put(*column);
}

void CompensatedSums::restore(Snapshot& from) {
  for (Extended* column : remainders())
    for (long double& entry : *column) {
      entry = 0.0L;
      for (int k = 0; k < doubles_of_extended; ++k) entry += from.number();
    }
  for (Vector* column : points()) from.read(*column);
}

void CompensatedSums::begin(const Vector& q0, const Vector& p0, const Vector& last_q0,
                            const Vector& last_p0) {
  if (q0 == end_q_ && p0 == end_p_) {
    start_ = end_;
  } else if (q0 == last_q0 && p0 == last_p0) {
    return;  // the same step once more
  } else if (q0 == kept_q_ && p0 == kept_p_) {
    start_ = kept_;
  } else {
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
