#pragma once

#include <string>

namespace diracstep {

/// Keeps a file that is replaced now and then for one process: the lock is on a file PATH.lock beside it,
/// which is removed in the end.  A process that is killed leaves PATH.lock behind, unlocked, and the next one
/// takes it.
class FileLock {
 public:
  /// Throws Misuse where another process has the lock, and where PATH.lock cannot be made or is a link or no
  /// regular file.  Devices, which are never replaced, and file systems without locks have none.
  explicit FileLock(const std::string& path);
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

 private:
  std::string name_;
  int descriptor_ = -1;
};

/// Locks an open file for this process until it is closed: false where another one has it.  True where the
/// file system knows no locks.
bool take_lock(int descriptor);

}  // namespace diracstep
