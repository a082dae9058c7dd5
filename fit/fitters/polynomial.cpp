#include "fit/polynomial.hpp"

#include "fit/linear_fitter.hpp"

namespace combforce {

template std::unique_ptr<Fitter> make_fitter<Polynomial>(const FitterSetup&);

}  // namespace combforce
