#include "fit/dmt.hpp"

#include "fit/model_fitter.hpp"

namespace combforce {

template std::unique_ptr<Fitter> make_fitter<Dmt>(const FitterSetup&);

}  // namespace combforce
