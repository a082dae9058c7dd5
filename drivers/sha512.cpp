#include "drivers/sha512.hpp"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <array>
#include <stdexcept>

namespace combforce {

namespace {

EVP_MD_CTX* evp(const auto& context) {
  return static_cast<EVP_MD_CTX*>(context.get());
}

void require(int status) {
  if (status != 1) throw std::runtime_error("SHA-512: libcrypto reports an error");
}

}  // namespace

void Sha512::Free::operator()(void* context) const {
  EVP_MD_CTX_free(static_cast<EVP_MD_CTX*>(context));
}

Sha512::Sha512() : context_(EVP_MD_CTX_new()) {
  require(context_ != nullptr ? EVP_DigestInit_ex(evp(context_), EVP_sha512(), nullptr) : 0);
}

Sha512::~Sha512() = default;

void Sha512::update(const void* data, std::size_t bytes) {
  require(EVP_DigestUpdate(evp(context_), data, bytes));
}

std::string Sha512::hex() const {
  const std::unique_ptr<void, Free> copy(EVP_MD_CTX_new());
  std::array<unsigned char, 64> digest{};
  require(copy != nullptr ? EVP_MD_CTX_copy_ex(evp(copy), evp(context_)) : 0);
  require(EVP_DigestFinal_ex(evp(copy), digest.data(), nullptr));
  return fmt::format("{:02x}", fmt::join(digest, ""));
}

}  // namespace combforce
