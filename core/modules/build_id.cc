#include "core/modules/build_id.h"

#include <elf.h>

#include "core/files/file.h"

namespace cairn {
namespace {

// The linker's hash of an object's contents; empty when it has none.
std::string BuildId(const dl_phdr_info& object) {
  constexpr auto align = [](size_t size) { return (size + 3) & ~size_t{3}; };
  for (int i = 0; i < object.dlpi_phnum; ++i) {
    const ElfW(Phdr)& header = object.dlpi_phdr[i];
    if (header.p_type != PT_NOTE) continue;
    const char* const notes = reinterpret_cast<const char*>(object.dlpi_addr + header.p_vaddr);
    for (size_t offset = 0; offset + sizeof(ElfW(Nhdr)) <= header.p_memsz;) {
      const auto& note = *reinterpret_cast<const ElfW(Nhdr)*>(notes + offset);
      const size_t contents = offset + sizeof(note) + align(note.n_namesz);
      const size_t end = contents + align(note.n_descsz);
      if (end > header.p_memsz) break;
      if (note.n_type == NT_GNU_BUILD_ID) return {notes + contents, note.n_descsz};
      offset = end;
    }
  }
  return "";
}

}  // namespace

std::string IdOfLibrary(const dl_phdr_info& library) {
  std::string id = BuildId(library);
  if (!id.empty()) return id;
  const auto hash = HashFile(library.dlpi_name);
  return hash.ok() ? *hash : library.dlpi_name;
}

}  // namespace cairn
