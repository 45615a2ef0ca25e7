#include <diracstep/plugins/shared_object.hpp>

#if __has_include(<link.h>)
#include <link.h>

#include <cstdint>
#include <cstring>
#include <fstream>

namespace diracstep {

namespace {

template <class Header>
bool read(std::ifstream& file, std::uint64_t position, Header& header) {
  file.seekg(static_cast<std::streamoff>(position));
  return static_cast<bool>(file.read(reinterpret_cast<char*>(&header), sizeof header));
}

constexpr int native_class = sizeof(void*) == 8 ? ELFCLASS64 : ELFCLASS32;

}  // namespace

std::string damage_of(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return "it is no file";
  const std::uint64_t size = std::filesystem::file_size(path, error);
  std::ifstream file(path, std::ios::binary);
  ElfW(Ehdr) header{};
  if (error || !read(file, 0, header)) return "it is too short for a shared object, or cannot be read";
  if (std::memcmp(header.e_ident, ELFMAG, SELFMAG) != 0) return "it is no ELF file";
  if (header.e_ident[EI_CLASS] != native_class) return "it is an ELF file of another word size";
  if (header.e_phentsize != sizeof(ElfW(Phdr))) return "its ELF header is damaged";
  for (unsigned k = 0; k < header.e_phnum; ++k) {
    ElfW(Phdr) segment{};
    if (header.e_phoff > size || !read(file, header.e_phoff + k * sizeof segment, segment))
      return "it ends within its ELF headers";
    if (segment.p_filesz > size || segment.p_offset > size - segment.p_filesz)
      return "it is cut off: a segment lies beyond its " + std::to_string(size) + " bytes";
  }
  return {};
}

}  // namespace diracstep

#else

namespace diracstep {
std::string damage_of(const std::filesystem::path&) { return {}; }
}  // namespace diracstep

#endif
