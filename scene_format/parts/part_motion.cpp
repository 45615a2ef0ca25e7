#include <algorithm>
#include <diracstep/core/methods/composition.hpp>
#include <diracstep/scene_format/parts/part_motion.hpp>

namespace diracstep {

PartMotion::PartMotion(std::unique_ptr<ScenePart> part)
    : part_(std::move(part)),
      time_(part_->start_time()),
      q_(part_->start_q()),
      p_(part_->mass().cwiseProduct(part_->start_v()) + part_->offset()),
      force_(part_->own()) {
  for (const PartNeighbour& neighbour : part_->neighbours())
    messages_.push_back({neighbour.part, std::vector<double>(neighbour.sent.size()),
                         std::vector<double>(neighbour.received.size())});
}

Vector PartMotion::v() const { return (p_ - part_->offset()).cwiseQuotient(part_->mass()); }

void PartMotion::kick(double h) { p_ += h * force_; }

void PartMotion::drift(double h) {
  q_.head(part_->own()).array() += h * (p_ - part_->offset()).array() / part_->mass().array();
  time_ += h;
}

std::vector<PartMessage>& PartMotion::messages() {
  for (std::size_t k = 0; k < messages_.size(); ++k) {
    const std::vector<int>& sent = part_->neighbours()[k].sent;
    for (std::size_t i = 0; i < sent.size(); ++i) messages_[k].out[i] = q_[sent[i]];
    ++traffic_.messages;
    traffic_.bytes += static_cast<long>(sent.size() * sizeof(double));
  }
  return messages_;
}

void PartMotion::take() {
  for (std::size_t k = 0; k < messages_.size(); ++k) {
    const std::vector<int>& received = part_->neighbours()[k].received;
    for (std::size_t i = 0; i < received.size(); ++i) q_[received[i]] = messages_[k].in[i];
  }
}

void exchange_here(std::span<PartMotion> parts) {
  std::vector<std::vector<PartMessage>*> all;
  for (PartMotion& part : parts) all.push_back(&part.messages());
  for (std::size_t from = 0; from < all.size(); ++from)
    for (const PartMessage& message : *all[from]) {
      auto& others = *all[static_cast<std::size_t>(message.with)];
      std::ranges::find(others, static_cast<int>(from), &PartMessage::with)->in = message.out;
    }
  for (PartMotion& part : parts) part.take();
}

void run_parts(std::span<PartMotion> parts, const PartExchange& exchange, int order, double step, long steps,
               const std::function<bool(long)>& goes_on) {
  const std::span<const double> fractions = composition_fractions(order);
  const auto look = [&] {
    exchange(parts);
    for (PartMotion& part : parts) part.look();
  };
  look();
  for (long k = 1; k <= steps; ++k) {
    for (const double fraction : fractions) {
      const double h = fraction * step;
      for (PartMotion& part : parts) {
        part.kick(h / 2.0);
        part.drift(h);
      }
      look();
      for (PartMotion& part : parts) part.kick(h / 2.0);
    }
    if (!goes_on(k)) return;
  }
}

}  // namespace diracstep
