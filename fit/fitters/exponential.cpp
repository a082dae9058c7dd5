#include "fit/exponential.hpp"

#include "fit/model_fitter.hpp"

namespace combforce {

template std::unique_ptr<Fitter> make_fitter<Exponential>(const FitterSetup&);

}  // namespace combforce
