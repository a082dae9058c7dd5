#include "fit/capillary.hpp"

#include "fit/model_fitter.hpp"

namespace combforce {

template std::unique_ptr<Fitter> make_fitter<Capillary>(const FitterSetup&);

}  // namespace combforce
