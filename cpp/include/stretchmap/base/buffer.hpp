// Large arrays that threads fill.
#pragma once

#include <memory>
#include <utility>
#include <vector>

namespace stretchmap {

// Leaves numbers unset that are given no value.
template <class T>
struct UnsetAllocator : std::allocator<T> {
  template <class U>
  struct rebind {
    using other = UnsetAllocator<U>;
  };

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
