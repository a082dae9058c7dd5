#include "fit/dlvo.hpp"

#include "fit/model_fitter.hpp"

namespace combforce {

template std::unique_ptr<Fitter> make_fitter<Dlvo>(const FitterSetup&);

}  // namespace combforce
