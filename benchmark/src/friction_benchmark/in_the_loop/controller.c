/* The cascade of closed_loop.py in C: call it once every millisecond. Build it with -ffp-contract=off, and it gives the
   same commands bit for bit. */
#include <math.h>
#include <stdint.h>

typedef struct {
    double position_n_m, integral_1_s, force_m_s_n, share, most_n, piston_area_m2, annulus_area_m2;
    double extend_m_s, retract_m_s, overlap, knee, null_m_s;
} loop_gains;

static double within(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

/* The spool command, -1 to 1. `reference_m` is now and one cycle later; `sample` is p1, p2 [Pa], x [m] and load [N]. */
double loop_control(const loop_gains *gains, double *integral, const double reference_m[2], const double sample[4],
                    double friction_n)
{
    const double error = reference_m[0] - sample[2];
    const double stiffness = gains->position_n_m * gains->integral_1_s;
    const double most = gains->most_n / (stiffness > 1e-9 ? stiffness : 1e-9);
    double wanted_n, force_n, speed, opened;
    *integral = within(*integral + 1e-3 * error, -most, most);
    wanted_n = gains->position_n_m * (error + gains->integral_1_s * *integral) + sample[3] + gains->share * friction_n;
    force_n = sample[0] * gains->piston_area_m2 - sample[1] * gains->annulus_area_m2;
    speed = (reference_m[1] - reference_m[0]) / 1e-3 + gains->force_m_s_n * (wanted_n - force_n) + gains->null_m_s;
    opened = speed / (speed > 0.0 ? gains->extend_m_s : gains->retract_m_s);
    opened += gains->overlap * within(opened / gains->knee, -1.0, 1.0);
    return within(opened, -1.0, 1.0);
}

/* Calls the step of an exported estimator: compiled Python reaches it by its address. */
void loop_estimate(uintptr_t step, uintptr_t state, double pressure_1_pa, double pressure_2_pa, double position_m,
                   void *output)
{
    typedef void step_function(void *, double, double, double, void *);
    ((step_function *)step)((void *)state, pressure_1_pa, pressure_2_pa, position_m, output);
}
