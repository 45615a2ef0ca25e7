#pragma once

#include <string>
#include <string_view>

namespace diracstep {

/// A file that is written to the end, or not without a word: every refusal of the system is an exception.
/// While it is open no other OutputFile, of this or another process, writes it.
class OutputFile {
 public:
  enum class Mode {
    fresh,     ///< emptied or made
    existing,  ///< kept as it is, written at its end
  };

  /// Throws Misuse, naming the path and the reason, where the file cannot be opened, where another run writes
  /// it, and for a pipe that nobody reads.
  OutputFile(const std::string& path, Mode mode);
  /// Standard output, from where it stands; throws Misuse where it is closed.
  static OutputFile on_standard_output();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  OutputFile(OutputFile&& other) noexcept;
  OutputFile& operator=(OutputFile&&) = delete;
  ~OutputFile();

  const std::string& path() const { return path_; }

  /// All throw Error, naming the path and the reason: a full disk, a quota, an unplugged device.
  void write(std::string_view bytes);  ///< all or, where the file can be cut, none of them
  void sync();                         ///< on the disk, and its name too, not only in the system's memory
  void close();
  void cut(long size);  ///< leaves the first `size` bytes and goes on there
  long size() const;
  /// The first `count` bytes, fewer where the file is shorter.
  std::string beginning(long count) const;

 private:
  OutputFile() = default;
  [[noreturn]] void refuse(const char* what) const;

  std::string path_;
  int descriptor_ = -1;
  bool shared_ = false;       ///< others write it as well, so it is never cut
  bool name_is_new_ = false;  ///< its folder has not been synchronised since it was opened
};

/// A new file PATH.new that becomes the one at `path` at once, or nothing: see replace_file().  `path` is no
/// link and no device.
class Replacement {
 public:
  explicit Replacement(const std::string& path);
  ~Replacement();
  Replacement(const Replacement&) = delete;
  Replacement& operator=(const Replacement&) = delete;

  const std::string& name() const { return fresh_; }  ///< until it becomes the other
  int descriptor() const { return descriptor_; }
  void write(std::string_view bytes) const;
  void become();

 private:
  bool remove_leftover() const;
  [[noreturn]] void refuse(const char* what) const;

  std::string path_, fresh_;
  int descriptor_ = -1;
};

/// Replaces the file at `path` by `bytes` at once: whoever reads it, at whatever moment the machine stops,
/// finds the old contents or the new ones.  A new file PATH.new is used on the way; a link or folder of that
/// name is refused, and a file there is removed unless its writer lives.  Where `path` is a link, the file it
/// leads to is replaced; the permissions stay.  Throws as OutputFile does.
void replace_file(const std::string& path, std::string_view bytes);

/// Makes the names in a folder last: where a system stops, a folder may be older than its files.
void sync_folder(const std::string& folder);

}  // namespace diracstep
