#include "daemon/serve/rpc.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <utility>

#include "daemon/serve/json_schema.hpp"

namespace combforce {

namespace {

// Messages of a client have no file.
const std::string no_file;

Json error_answer(const Json& id, const RpcError& error) {
  Json object{{"code", error.code}, {"message", error.message}};
  if (!error.data.is_null()) object["data"] = error.data;
  return {{"jsonrpc", "2.0"}, {"id", id}, {"error", object}};
}

Json answer_to(const Json& id, const RpcResult& result) {
  if (const auto* error = std::get_if<RpcError>(&result)) return error_answer(id, *error);
  return {{"jsonrpc", "2.0"}, {"id", id}, {"result", std::get<Json>(result)}};
}

bool is_id(const Json& value) {
  return value.is_string() || value.is_number() || value.is_null();
}

// Why this is no request; empty when it is one.
std::string malformed(const Json& request) {
  if (!request.is_object()) return "a request is an object";
  const auto version = request.find("jsonrpc");
  if (version == request.end() || *version != "2.0") return R"("jsonrpc" must be "2.0")";
  const auto method = request.find("method");
  if (method == request.end() || !method->is_string()) return R"("method" must be a string)";
  if (const auto id = request.find("id"); id != request.end() && !is_id(*id)) {
    return R"("id" must be a string, a number or null)";
  }
  if (const auto params = request.find("params"); params != request.end() && !params->is_structured()) {
    return R"("params" must be an object)";
  }
  for (const auto& member : request.items()) {
    if (member.key() != "jsonrpc" && member.key() != "method" && member.key() != "id" &&
        member.key() != "params") {
      return fmt::format("unknown member \"{:.40}\"", member.key());
    }
  }
  return {};
}

Json id_of(const Json& request) {
  if (!request.is_object()) return nullptr;
  const auto id = request.find("id");
  return id != request.end() && is_id(*id) ? *id : Json(nullptr);
}

// All but notifications; a notification is a request without an id.
bool answer_is_due(const Json& request) {
  return !malformed(request).empty() || request.contains("id");
}

RpcError current_error() {
  try {
    throw;
  } catch (const InputError& error) {
    return {rpc_invalid_params, error.message(), {{"pointer", error.pointer()}}};
  } catch (const std::invalid_argument& error) {
    return {rpc_invalid_params, error.what(), {{"pointer", ""}}};
  } catch (const std::exception& error) {
    return {rpc_instrument_error, error.what(), nullptr};
  }
}

// The answers of a batch, in the order of its requests; sent when the last one that is due is there.
struct BatchAnswers {
  std::vector<Json> answers;
  std::size_t due = 0;
};

}  // namespace

std::string message_line(const Json& message) {
  return message.dump(-1, ' ', false, Json::error_handler_t::replace) + '\n';
}

RpcTable::RpcTable(std::string title, std::string version)
    : title_(std::move(title)), version_(std::move(version)) {
  add({"rpc.discover",
       "This document: every method there is, with the schemas that are enforced.",
       {{"type", "object"}, {"properties", Json::object()}, {"additionalProperties", false}},
       {{"type", "object"}},
       RpcHandler([this](const JsonView&, Subscriptions&) { return discover(); })});
}

void RpcTable::add(RpcMethod method) {
  if (find(method.name) != nullptr)
    throw std::logic_error(fmt::format("method {} is there twice", method.name));
  methods_.push_back(std::move(method));
}

const RpcMethod* RpcTable::find(std::string_view name) const {
  const auto found = std::ranges::find_if(methods_, [&](const auto& m) { return m.name == name; });
  return found == methods_.end() ? nullptr : &*found;
}

void RpcTable::handle(std::string_view line, Subscriptions& caller,
                      const std::function<void(std::string)>& reply) const {
  Json message;
  try {
    message = parse_json(line, no_file);
  } catch (const InputError& error) {
    reply(message_line(error_answer(nullptr, {rpc_parse_error, error.what(), nullptr})));
    return;
  }
  if (message.is_array()) {
    handle_batch(message, caller, reply);
  } else {
    call(message, caller, [reply](const Json& answer) { reply(message_line(answer)); });
  }
}

void RpcTable::handle_batch(const Json& requests, Subscriptions& caller,
                            const std::function<void(std::string)>& reply) const {
  if (requests.empty() || requests.size() > max_batch) {
    const RpcError error{rpc_invalid_request,
                         fmt::format("a batch holds 1 to {} requests, not {}", max_batch, requests.size()),
                         nullptr};
    reply(message_line(error_answer(nullptr, error)));
    return;
  }
  const auto batch = std::make_shared<BatchAnswers>();
  batch->due = static_cast<std::size_t>(std::ranges::count_if(requests, answer_is_due));
  batch->answers.resize(batch->due);
  std::size_t place = 0;
  for (const Json& request : requests) {
    call(request, caller, [batch, reply, at = place](Json answer) {
      batch->answers[at] = std::move(answer);
      if (--batch->due == 0) reply(message_line(batch->answers));
    });
    if (answer_is_due(request)) ++place;
  }
}

void RpcTable::call(const Json& request, Subscriptions& caller,
                    const std::function<void(Json)>& answer) const {
  const Json id = id_of(request);
  if (const std::string why = malformed(request); !why.empty()) {
    answer(error_answer(id, {rpc_invalid_request, why, nullptr}));
    return;
  }
  RpcRespond respond = [](const RpcResult&) {};
  if (request.contains("id")) {
    respond = [id, answer](const RpcResult& result) { answer(answer_to(id, result)); };
  }
  try {
    invoke(request, caller, respond);
  } catch (const std::exception&) {
    respond(current_error());
  }
}

void RpcTable::invoke(const Json& request, Subscriptions& caller, const RpcRespond& respond) const {
  const auto& name = request["method"].get_ref<const std::string&>();
  const RpcMethod* method = find(name);
  if (method == nullptr) {
    respond(RpcError{
        rpc_method_not_found, fmt::format("no method \"{:.80}\" here; rpc.discover lists them", name), {}});
    return;
  }
  const Json params = request.value("params", Json::object());
  const JsonView view(params, no_file);
  check_schema(view, method->params);
  if (const auto* handler = std::get_if<RpcHandler>(&method->handler)) {
    respond((*handler)(view, caller));
  } else {
    std::get<RpcDeferredHandler>(method->handler)(view, caller, respond);
  }
}

void RpcTable::gone(const Subscriptions& caller) const {
  for (const RpcMethod& method : methods_) {
    if (method.gone) method.gone(caller);
  }
}

Json RpcTable::discover() const {
  Json methods = Json::array();
  for (const RpcMethod& method : methods_) {
    Json params = Json::array();
    const Json required = method.params.value("required", Json::array());
    const Json properties = method.params.value("properties", Json::object());
    for (const auto& item : properties.items()) {
      const bool needed = std::ranges::find(required, Json(item.key())) != required.end();
      params.push_back({{"name", item.key()}, {"required", needed}, {"schema", item.value()}});
    }
    methods.push_back({{"name", method.name},
                       {"summary", method.summary},
                       {"paramStructure", "by-name"},
                       {"params", params},
                       {"result", {{"name", "result"}, {"schema", method.result}}}});
  }
  return {{"openrpc", "1.2.6"}, {"info", {{"title", title_}, {"version", version_}}}, {"methods", methods}};
}

}  // namespace combforce
