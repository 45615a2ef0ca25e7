#pragma once

#include <memory>
#include <mutex>
#include <vector>

namespace diracstep::scene_compiler {

/// Pieces of memory that keep their size from call to call; calls at the same time have one each.  An object
/// of a thread would do, were it not that glibc ends the program where no memory is left to note its
/// destructor.
template <class T>
class MemoryPool {
 public:
  /// A piece, until the end of the block.
  class Loan {
   public:
    /// Throws std::bad_alloc.
    explicit Loan(MemoryPool& pool) : pool_(pool), piece_(pool.taken()) {}
    ~Loan() { pool_.give_back(std::move(piece_)); }
    Loan(const Loan&) = delete;
    Loan& operator=(const Loan&) = delete;
    T& operator*() { return *piece_; }

   private:
    MemoryPool& pool_;
    std::unique_ptr<T> piece_;
  };

 private:
  std::unique_ptr<T> taken() {
    const std::lock_guard lock(guard_);
    if (idle_.empty()) {
      idle_.reserve(made_ + 1);  // so that it can be given back without memory
      auto piece = std::make_unique<T>();
      ++made_;
      return piece;
    }
    std::unique_ptr<T> piece = std::move(idle_.back());
    idle_.pop_back();
    return piece;
  }
  void give_back(std::unique_ptr<T> piece) noexcept {
    const std::lock_guard lock(guard_);
    idle_.push_back(std::move(piece));
  }

  std::mutex guard_;
  std::vector<std::unique_ptr<T>> idle_;
  std::size_t made_ = 0;
};

}  // namespace diracstep::scene_compiler
