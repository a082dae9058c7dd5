#include "fit/cone.hpp"

#include "fit/model_fitter.hpp"

namespace combforce {

template std::unique_ptr<Fitter> make_fitter<Cone>(const FitterSetup&);

}  // namespace combforce
