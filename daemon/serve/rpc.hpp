// JSON-RPC 2.0 without sockets: one table of methods drives dispatch, validation of parameters and
// rpc.discover.
//
// Parameters are passed by name. Errors: -32700 not JSON (or a duplicate key), -32600 not a request, -32601
// unknown method, -32602 invalid parameters with data {pointer} into params, -32000 the instrument's own.
// Thread-bound.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "daemon/serve/topics.hpp"
#include "proto/json.hpp"

namespace combforce {

struct RpcError {
  int code = 0;
  std::string message;
  Json data;  // null: none
};

inline constexpr int rpc_parse_error = -32700;
inline constexpr int rpc_invalid_request = -32600;
inline constexpr int rpc_method_not_found = -32601;
inline constexpr int rpc_invalid_params = -32602;
inline constexpr int rpc_instrument_error = -32000;

using RpcResult = std::variant<Json, RpcError>;

// Answers at once. Throws InputError or std::invalid_argument (invalid parameters), any other std::exception
// (instrument error). `params` is an object that has passed the schema.
using RpcHandler = std::function<Json(const JsonView& params, Subscriptions& caller)>;
// Answers by calling `respond` once, on this thread, now or later. Throws as above instead of responding.
using RpcRespond = std::function<void(RpcResult)>;
using RpcDeferredHandler =
    std::function<void(const JsonView& params, const Subscriptions& caller, RpcRespond respond)>;

struct RpcMethod {
  std::string name;
  std::string summary;
  Json params;  // schema of the params object: type, properties, required, additionalProperties
  Json result;  // schema of the result, for rpc.discover
  std::variant<RpcHandler, RpcDeferredHandler> handler;
  // Empty, or called when a client has gone: its `caller` is known by its address and is not used again.
  std::function<void(const Subscriptions& caller)> gone = {};
};

class RpcTable {
 public:
  static constexpr std::size_t max_batch = 64;  // requests in a batch: bounds the replies to one line

  // `title` and `version` for rpc.discover, which is listed like any other.
  RpcTable(std::string title, std::string version);
  RpcTable(const RpcTable&) = delete;
  RpcTable& operator=(const RpcTable&) = delete;

  void add(RpcMethod method);

  // Handles one line: a request, a notification or a batch. `reply` is called at most once, with the answer
  // and its newline, on this thread, now or later; never when no answer is due.
  void handle(std::string_view line, Subscriptions& caller,
              const std::function<void(std::string)>& reply) const;

  // The client of these subscriptions has gone: tells the methods that want to know.
  void gone(const Subscriptions& caller) const;

  // The OpenRPC document of everything in the table.
  Json discover() const;

 private:
  const RpcMethod* find(std::string_view name) const;
  void call(const Json& request, Subscriptions& caller, const std::function<void(Json)>& answer) const;
  void invoke(const Json& request, Subscriptions& caller, const RpcRespond& respond) const;
  void handle_batch(const Json& requests, Subscriptions& caller,
                    const std::function<void(std::string)>& reply) const;

  std::string title_, version_;
  std::vector<RpcMethod> methods_;
};

// A message as it is sent: one line with its newline; text that is not UTF-8 is mended.
std::string message_line(const Json& message);

}  // namespace combforce
