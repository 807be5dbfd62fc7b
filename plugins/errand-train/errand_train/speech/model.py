"""Whisper (Radford and others, 2022) in torch, with the weights of a `model.bin`, and low-rank adapters beside them.

Only the adapters learn: W x becomes W x + B A x, with A of few rows (Hu and others, "LoRA: low-rank adaptation of large
language models", 2021). Names and shapes are those of CTranslate2, where query, key and value are one matrix.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Final

import numpy as np
import torch
import torch.nn.functional as tf
from torch import Tensor, nn

from errand_train.detector.learner import quick_in_bfloat16
from executive.speech.adapter import Adapter, LowRank, ModelFile

__all__ = ["AdaptedWhisper"]

_HEADS: Final = 8
_LAYERS: Final = 6
_START_SCALE: Final = 0.02


class AdaptedWhisper(nn.Module):
    """Whisper with adapters. `ranks` gives the rank of the adapter of every matrix whose name begins with the key.

    Computes by default in bfloat16 where the processor is quick in it, else in float32.
    """

    def __init__(self, weights: ModelFile, ranks: Mapping[str, int], dtype: torch.dtype | None = None) -> None:
        super().__init__()
        self.dtype = dtype or (torch.bfloat16 if quick_in_bfloat16(torch.device("cpu")) else torch.float32)
        make = _Maker(weights, ranks, self.dtype)
        self.convolutions = nn.ModuleList([make.convolution("encoder/conv1", 1), make.convolution("encoder/conv2", 2)])
        self.listening = nn.ModuleList(_Layer(make, f"encoder/layer_{n}", cross=False) for n in range(_LAYERS))
        self.listened = make.norm("encoder/layer_norm")
        self.writing = nn.ModuleList(_Layer(make, f"decoder/layer_{n}", cross=True) for n in range(_LAYERS))
        self.written = make.norm("decoder/layer_norm")
        self.register_buffer("times", make.tensor("encoder/position_encodings/encodings", torch.float32))
        self.register_buffer("places", make.tensor("decoder/position_encodings/encodings", torch.float32))
        self.register_buffer("words", make.tensor("decoder/embeddings/weight", self.dtype))

    def encode(self, features: Tensor) -> Tensor:
        """Encodes features (batch, 80, frames) to (batch, frames / 2, 512)."""
        heard = features.to(self.dtype)
        for convolution in self.convolutions:
            heard = tf.gelu(convolution(heard))
        state = heard.transpose(1, 2).float()
        state = state + self.times[: state.shape[1]]
        for layer in self.listening:
            state, _ = layer(state)
        return self.listened(state).to(self.dtype)

    def states(self, heard: Tensor, prompt: Tensor, lengths: Tensor, text: Tensor) -> Tensor:
        """States of the decoder after each token of a text: (batch, tokens, 512).

        The first `lengths` (batch,) tokens of `prompt` (batch, most) precede the text. The prompt has no gradients,
        which halves the work.
        """
        with torch.no_grad():
            told = self._prompted(heard.detach(), prompt)
        count, most = text.shape[1], prompt.shape[1]
        own = torch.ones(count, count, dtype=torch.bool).tril().expand(len(text), count, count)
        before = (torch.arange(most) < lengths[:, None])[:, None].expand(len(text), count, most)
        mask = torch.cat([before, own], dim=2)[:, None]
        state = tf.embedding(text, self.words).float() + self.places[lengths[:, None] + torch.arange(count)]
        for layer, known in zip(self.writing, told, strict=True):
            state, _ = layer(state, heard, known, mask)
        return self.written(state).to(self.dtype)

    def _prompted(self, heard: Tensor, prompt: Tensor) -> list[tuple[Tensor, Tensor]]:
        """The keys and values of the prompt in each layer."""
        state = tf.embedding(prompt, self.words).float() + self.places[: prompt.shape[1]]
        told = list[tuple[Tensor, Tensor]]()
        for layer in self.writing:
            state, known = layer(state, heard)
            told.append(known)
        return told

    def logits(self, states: Tensor) -> Tensor:
        """Logits of the next token (any, 51865) from states (any, 512)."""
        return tf.linear(states, self.words).float()

    @contextmanager
    def as_published(self) -> Iterator[None]:
        """Context without adapters and without gradients."""
        adapted = tuple(self.adapted_layers())
        for part in adapted:
            part.active = False
        try:
            with torch.no_grad():
                yield
        finally:
            for part in adapted:
                part.active = True

    def adapted_layers(self) -> Iterator[AdaptedLinear]:
        """Yields the matrices that have an adapter."""
        return (part for part in self.modules() if isinstance(part, AdaptedLinear) and part.rank)

    def adapter(self) -> Adapter:
        """Trained weights of the adapters."""
        return Adapter({part.name: part.low_rank() for part in self.adapted_layers()})


class AdaptedLinear(nn.Module):
    """One frozen matrix, with an adapter beside it where `rank` is not 0."""

    def __init__(self, name: str, weight: Tensor, bias: Tensor, rank: int) -> None:
        super().__init__()
        self.name, self.rank, self.active = name, rank, True
        self.register_buffer("weight", weight)
        self.register_buffer("bias", bias)
        if rank:
            self.down = nn.Parameter(torch.randn(rank, weight.shape[1]) * _START_SCALE)
            self.up = nn.Parameter(torch.zeros(weight.shape[0], rank))

    def forward(self, x: Tensor) -> Tensor:
        """Computes (..., outputs) from (..., inputs)."""
        y = tf.linear(x, self.weight, self.bias)
        if not (self.rank and self.active):
            return y
        return y + tf.linear(tf.linear(x, self.down.to(x.dtype)), self.up.to(x.dtype))

    def low_rank(self) -> LowRank:
        """Trained weights of the adapter."""
        up, down = (part.detach().float().numpy().astype(np.float16) for part in (self.up, self.down))
        return LowRank(up, down)


class _Convolution(nn.Module):
    """A convolution over three frames, written as a matrix so that it may have an adapter."""

    def __init__(self, linear: AdaptedLinear, stride: int) -> None:
        super().__init__()
        self.linear, self.stride = linear, stride

    def forward(self, x: Tensor) -> Tensor:
        padded = tf.pad(x, (1, 1)).unfold(2, 3, self.stride)
        batch, channels, frames, width = padded.shape
        flat = padded.permute(0, 2, 1, 3).reshape(batch, frames, channels * width)
        moved: Tensor = self.linear(flat).transpose(1, 2)
        return moved


class _Norm(nn.Module):
    def __init__(self, gain: Tensor, offset: Tensor) -> None:
        super().__init__()
        self.register_buffer("gain", gain)
        self.register_buffer("offset", offset)

    def forward(self, x: Tensor) -> Tensor:
        return tf.layer_norm(x, (x.shape[-1],), self.gain, self.offset)


class _Maker:
    """Makes the parts of the network from the weights."""

    def __init__(self, weights: ModelFile, ranks: Mapping[str, int], dtype: torch.dtype) -> None:
        self.weights, self.ranks, self.dtype = weights, ranks, dtype

    def tensor(self, name: str, dtype: torch.dtype) -> Tensor:
        return torch.from_numpy(self.weights[name].astype(np.float32)).to(dtype)

    def linear(self, name: str) -> AdaptedLinear:
        rank = next((rank for start, rank in self.ranks.items() if name.startswith(start)), 0)
        weight = self.tensor(f"{name}/weight", self.dtype).flatten(1)
        return AdaptedLinear(f"{name}/weight", weight, self.tensor(f"{name}/bias", self.dtype), rank)

    def convolution(self, name: str, stride: int) -> _Convolution:
        return _Convolution(self.linear(name), stride)

    def norm(self, name: str) -> _Norm:
        return _Norm(self.tensor(f"{name}/gamma", torch.float32), self.tensor(f"{name}/beta", torch.float32))


class _Layer(nn.Module):
    """Attention to itself, attention to what was heard (`cross`), and two matrices with a bend between."""

    def __init__(self, make: _Maker, name: str, *, cross: bool) -> None:
        super().__init__()
        self.causal = cross
        self.norms = nn.ModuleDict({"own": make.norm(f"{name}/self_attention/layer_norm")})
        self.norms["last"] = make.norm(f"{name}/ffn/layer_norm")
        self.own = nn.ModuleList(make.linear(f"{name}/self_attention/linear_{n}") for n in range(2))
        self.last = nn.ModuleList(make.linear(f"{name}/ffn/linear_{n}") for n in range(2))
        self.other = nn.ModuleList(make.linear(f"{name}/attention/linear_{n}") for n in range(3 if cross else 0))
        if cross:
            self.norms["other"] = make.norm(f"{name}/attention/layer_norm")

    def forward(
        self,
        state: Tensor,
        heard: Tensor | None = None,
        known: tuple[Tensor, Tensor] | None = None,
        mask: Tensor | None = None,
    ) -> tuple[Tensor, tuple[Tensor, Tensor]]:
        """The state behind the layer, and its keys and values; `known` are those of tokens before."""
        dtype = self.own[0].weight.dtype
        query, *own = self.own[0](self.norms["own"](state).to(dtype)).chunk(3, dim=-1)
        key, value = own if known is None else (torch.cat(pair, dim=1) for pair in zip(known, own, strict=True))
        causal = self.causal and mask is None
        state = state + self.own[1](_attended(query, key, value, mask, causal=causal)).float()
        if heard is not None:
            query = self.other[0](self.norms["other"](state).to(dtype))
            heard_key, heard_value = self.other[1](heard).chunk(2, dim=-1)
            state = state + self.other[2](_attended(query, heard_key, heard_value)).float()
        state = state + self.last[1](tf.gelu(self.last[0](self.norms["last"](state).to(dtype)))).float()
        return state, (key, value)


def _attended(query: Tensor, key: Tensor, value: Tensor, mask: Tensor | None = None, *, causal: bool = False) -> Tensor:
    """Attention of several heads, (batch, tokens, 512) each."""
    q, k, v = (part.unflatten(-1, (_HEADS, -1)).transpose(1, 2) for part in (query, key, value))
    attended = tf.scaled_dot_product_attention(q, k, v, attn_mask=mask, is_causal=causal)
    return attended.transpose(1, 2).flatten(2)
