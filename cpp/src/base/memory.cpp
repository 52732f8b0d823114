#include "stretchmap/base/memory.hpp"

#include <cstdint>
#include <cstdlib>  // defines __GLIBC__

#ifdef __GLIBC__
#include <malloc.h>
#endif
#ifdef __linux__
#include <sys/mman.h>
#endif

namespace stretchmap {

void give_free_memory_back() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

#ifdef MADV_HUGEPAGE
void prefer_large_pages(const void* begin, std::size_t bytes) {
  constexpr std::uintptr_t kPage = std::uintptr_t{1} << 21;
  const auto address = reinterpret_cast<std::uintptr_t>(begin);
  const std::uintptr_t first = (address + kPage - 1) / kPage * kPage;
  const std::uintptr_t last = (address + bytes) / kPage * kPage;
  if (first < last) madvise(reinterpret_cast<void*>(first), last - first, MADV_HUGEPAGE);
}
#else
void prefer_large_pages(const void*, std::size_t) {}
#endif

}  // namespace stretchmap
