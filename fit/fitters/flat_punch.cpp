#include "fit/flat_punch.hpp"

#include "fit/model_fitter.hpp"

namespace combforce {

template std::unique_ptr<Fitter> make_fitter<FlatPunch>(const FitterSetup&);

}  // namespace combforce
