// SHA-512 of a byte stream, as core:sha512 of a recording carries it.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

namespace combforce {

// Thread-bound.
class Sha512 {
 public:
  Sha512();  // throws std::runtime_error when libcrypto refuses
  ~Sha512();
  Sha512(const Sha512&) = delete;
  Sha512& operator=(const Sha512&) = delete;

  void update(const void* data, std::size_t bytes);
  // Of everything so far, 128 lower-case hexadecimal digits; more may follow.
  std::string hex() const;

 private:
  struct Free {
    void operator()(void* context) const;
  };
  std::unique_ptr<void, Free> context_;  // EVP_MD_CTX
};

}  // namespace combforce
