// Validation against the part of JSON Schema that the method table uses: the schemas that rpc.discover shows
// are the ones that are enforced.
#pragma once

#include "proto/json.hpp"

namespace combforce {

// Throws InputError at the place of the first violation. Keywords: type (object, array, string, integer,
// number, boolean), properties, required, additionalProperties (false), items, minItems, maxItems, enum (of
// strings), minimum, maximum, exclusiveMinimum, minLength, maxLength, pattern; title, description and default
// say nothing here. Any other keyword is an error of the schema: std::logic_error.
void check_schema(const JsonView& value, const Json& schema);

}  // namespace combforce
