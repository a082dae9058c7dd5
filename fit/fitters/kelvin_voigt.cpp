#include "fit/kelvin_voigt.hpp"

#include "fit/model_fitter.hpp"

namespace combforce {

template std::unique_ptr<Fitter> make_fitter<KelvinVoigt>(const FitterSetup&);

}  // namespace combforce
