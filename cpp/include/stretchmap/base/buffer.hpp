// Large arrays that threads fill.
#pragma once

#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "stretchmap/base/memory.hpp"

namespace stretchmap {

// Leaves numbers unset that are given no value, and asks for large pages.
template <class T>
struct UnsetAllocator : std::allocator<T> {
  template <class U>
  struct rebind {
    using other = UnsetAllocator<U>;
  };

  T* allocate(std::size_t n) {
    T* const begin = std::allocator<T>::allocate(n);
    prefer_large_pages(begin, n * sizeof(T));
    return begin;
  }
  template <class U>
  void construct(U* at) noexcept {
    ::new (static_cast<void*>(at)) U;
  }
  template <class U, class... Values>
  void construct(U* at, Values&&... values) {
    ::new (static_cast<void*>(at)) U(std::forward<Values>(values)...);
  }
};

// A vector whose `resize` sets nothing: setting is work for one thread, and so is getting memory
// from the system, which happens where it is first written to.
template <class T>
using Buffer = std::vector<T, UnsetAllocator<T>>;

}  // namespace stretchmap
