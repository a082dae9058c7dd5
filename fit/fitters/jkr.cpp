#include "fit/jkr.hpp"

#include "fit/model_fitter.hpp"

namespace combforce {

template std::unique_ptr<Fitter> make_fitter<Jkr>(const FitterSetup&);

}  // namespace combforce
