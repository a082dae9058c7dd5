#include "fit/lennard_jones.hpp"

#include "fit/model_fitter.hpp"

namespace combforce {

template std::unique_ptr<Fitter> make_fitter<LennardJones>(const FitterSetup&);

}  // namespace combforce
