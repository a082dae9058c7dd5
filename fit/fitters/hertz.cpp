#include "fit/hertz.hpp"

#include "fit/model_fitter.hpp"

namespace combforce {

template std::unique_ptr<Fitter> make_fitter<Hertz>(const FitterSetup&);

}  // namespace combforce
