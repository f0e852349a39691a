r"""The engine's posteriors against Markov chains of numpyro, which share no code with it.

    python -m validation.posteriors --problems 20 --out validation/posteriors.jsonl

Each problem has six hypotheses with ten columns, priors of two normal distributions each, a narrow
one and a wide one, and forty rows. The chain samples the coefficients under these mixtures (NUTS,
Hoffman and Gelman, JMLR 15 (2014)); how often a hypothesis is a cause, and means and deviations of
the coefficients, follow from its samples. The engine has the same from the evidence of all 64 sets
of causes, and a name with a probability from its search. Seeded; what stands in the output is not
done again. Status 1 where a chain contradicts the engine, 2 without numpyro.
"""

from __future__ import annotations

import argparse
import json
import time
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import logsumexp

from spacerobot_ros.inference.gram_blocks import GramBlocks
from spacerobot_ros.inference.hypotheses import Hypotheses
from spacerobot_ros.inference.hypothesis import Hypothesis
from spacerobot_ros.inference.inferred import infer
from spacerobot_ros.inference.model_search import ChosenSet

SIZES, ROWS, ODDS = (1, 1, 1, 2, 2, 3), 40, 3.0
NARROW = 0.15
"""Deviation of a tolerance by that of a cause: chains cross between the two."""
CHAINS, WARM_UP, SAMPLES = 4, 1000, 2000
ERRORS, ROUGHLY = 5.0, 0.01
"""Standard errors of a chain, and a probability beside them, that it may be off by: 20 problems
compare 520 numbers."""


def posed(seed: int) -> tuple[np.ndarray, np.ndarray, list[Hypothesis]]:
    """Rows (R, K), data (R,) and hypotheses, all drawn."""
    rng = np.random.default_rng([seed, 52])
    ends = np.cumsum(SIZES)
    places = np.split(np.arange(ends[-1]), ends[:-1])
    X = rng.standard_normal((ROWS, ends[-1])) + 0.5 * rng.standard_normal((ROWS, 1))
    every, x = [], np.zeros(ends[-1])
    for k, at in enumerate(places):
        root = 0.5 * (np.eye(len(at)) + 0.4 * rng.standard_normal((len(at), len(at))))
        slab = root @ root.T
        is_cause = rng.random() < 1.0 / 3.0
        x[at] = root @ rng.standard_normal(len(at)) * (1.0 if is_cause else NARROW)
        every.append(
            Hypothesis(key=k, columns=at, slab=slab, spike=NARROW**2 * slab, log_odds=ODDS)
        )
    return X, X @ x + rng.standard_normal(ROWS), every


def blocks_of(X: np.ndarray, y: np.ndarray) -> GramBlocks:
    """The rows, each a block of its own."""
    out = GramBlocks(X.shape[1])
    for k in range(len(y)):
        out.add(X[k : k + 1], y[k : k + 1])
    return out


def enumerated(hypotheses: Hypotheses) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Probability of each hypothesis, mean and deviation of each coefficient, over all sets."""
    count = len(hypotheses.every)
    sets = [frozenset(s) for n in range(count + 1) for s in combinations(range(count), n)]
    every = [ChosenSet.of(hypotheses, s) for s in sets]
    weight = np.array([one.objective for one in every])
    weight = np.exp(weight - logsumexp(weight))
    is_in = np.array([[i in s for i in range(count)] for s in sets])
    means, squares = [], []
    basis, columns = hypotheses.basis(range(count)), np.arange(hypotheses.blocks.count)
    for one in every:
        variances = hypotheses.variances(one.chosen)
        mean = basis @ one.marginal.mean(columns, variances)
        covariance = basis @ one.marginal.covariance(columns, variances) @ basis.T
        means.append(mean)
        squares.append(np.diag(covariance) + mean**2)
    mean = weight @ np.array(means)
    return weight @ is_in, mean, np.sqrt(weight @ np.array(squares) - mean**2)


def sampled(seed: int, X: np.ndarray, y: np.ndarray, hypotheses: Hypotheses) -> dict[str, Any]:
    """The same by chains, with standard errors of the probabilities and means, and r-hat."""
    import jax
    import jax.numpy as jnp
    import numpyro
    from numpyro.diagnostics import effective_sample_size, gelman_rubin

    numpyro.enable_x64()
    log_odds, groups = hypotheses.log_odds, range(len(hypotheses.every))

    def log_weights(x: Any, i: int) -> tuple[Any, Any]:
        """Log density of a group's coefficients as a cause and as none, with its odds."""
        at = hypotheses.every[i].columns
        squares = jnp.linalg.solve(hypotheses.bases[i], x[at]) ** 2
        narrow = hypotheses.spikes[at]
        wide = -0.5 * jnp.sum(squares) + log_odds[i]
        return wide, -0.5 * jnp.sum(squares / narrow) - 0.5 * np.sum(np.log(narrow))

    def model() -> None:
        with numpyro.handlers.mask(mask=False):
            x = numpyro.sample('x', numpyro.distributions.Normal(0.0, 1.0).expand([len(X.T)]))
        prior = sum(jnp.logaddexp(*log_weights(x, i)) for i in groups)
        numpyro.factor('rows', -0.5 * jnp.sum((y - X @ x) ** 2) + prior)

    kernel = numpyro.infer.NUTS(model, target_accept_prob=0.9)
    chains = numpyro.infer.MCMC(
        kernel,
        num_warmup=WARM_UP,
        num_samples=SAMPLES,
        num_chains=CHAINS,
        chain_method='vectorized',
        progress_bar=False,
    )
    chains.run(jax.random.PRNGKey(seed))
    x = chains.get_samples(group_by_chain=True)['x']

    def shares(one: Any) -> Any:
        pairs = (log_weights(one, i) for i in groups)
        return jnp.stack([jax.nn.sigmoid(wide - narrow) for wide, narrow in pairs])

    cause = np.asarray(jax.vmap(jax.vmap(shares))(x))
    x = np.asarray(x)

    def error(values: np.ndarray) -> np.ndarray:
        return np.std(values, axis=(0, 1)) / np.sqrt(effective_sample_size(values))

    return {
        'probability': cause.mean(axis=(0, 1)),
        'probability_error': error(cause),
        'mean': x.mean(axis=(0, 1)),
        'mean_error': error(x),
        'std': x.std(axis=(0, 1)),
        'r_hat': float(np.max(gelman_rubin(x))),
    }


def compared(seed: int) -> dict[str, Any]:
    """One problem."""
    started = time.process_time()
    X, y, every = posed(seed)
    hypotheses = Hypotheses(blocks_of(X, y), every)
    probability, mean, std = enumerated(hypotheses)
    chain = sampled(seed, X, y, hypotheses)
    off = np.abs(chain['probability'] - probability)
    shift = np.abs(chain['mean'] - mean)
    agrees = (
        np.all(off < ERRORS * chain['probability_error'] + ROUGHLY)
        and np.all(shift < ERRORS * chain['mean_error'] + ROUGHLY * std)
        and np.all(np.abs(chain['std'] / std - 1.0) < 0.1)
    )
    named = {c.key: c.probability for c in infer(hypotheses.blocks, every).causes}
    return {
        'seed': seed,
        'probability': np.round(probability, 4).tolist(),
        'chain': np.round(chain['probability'], 4).tolist(),
        'chain_error': np.round(chain['probability_error'], 4).tolist(),
        'mean_off_std': float(np.max(shift / std)),
        'std_ratio': np.round(chain['std'] / std, 3).tolist(),
        'r_hat': chain['r_hat'],
        'named': {str(k): round(p, 4) for k, p in named.items()},
        'agrees': bool(agrees),
        'cpu_s': round(time.process_time() - started, 1),
    }


def main() -> int:
    """Compare, write, say."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').splitlines()[0])
    parser.add_argument('--problems', type=int, default=20)
    parser.add_argument('--first', type=int, default=0, help='first seed')
    parser.add_argument('--out', type=Path, default=Path('validation/posteriors.jsonl'))
    asked = parser.parse_args()
    try:
        import numpyro  # noqa: F401
    except ImportError:
        print('numpyro is not installed: pip install numpyro')
        return 2
    lines = asked.out.read_text(encoding='utf-8').splitlines() if asked.out.exists() else []
    done = {one['seed']: one for one in map(json.loads, lines)}
    for seed in range(asked.first, asked.first + asked.problems):
        if seed not in done:
            done[seed] = compared(seed)
            with asked.out.open('a', encoding='utf-8') as file:
                file.write(json.dumps(done[seed]) + '\n')
        one = done[seed]
        worst = np.max(np.abs(np.subtract(one['chain'], one['probability'])))
        print(
            f'{seed}: probabilities within {worst:.3f}, means within {one["mean_off_std"]:.3f} '
            f'deviations, r-hat {one["r_hat"]:.3f}: {"agrees" if one["agrees"] else "differs"}'
        )
    return int(not all(one['agrees'] for one in done.values()))


if __name__ == '__main__':
    raise SystemExit(main())
